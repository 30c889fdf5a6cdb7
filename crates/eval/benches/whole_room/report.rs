//! The measurements as tables.

use std::sync::Arc;

use mateval_eval::result::ResultFile;
use mateval_scene::material::PrincipledFlavour;
use mateval_scene::reference::ReferenceScene;
use mateval_tracer::World;

use crate::ITERATIONS;
use crate::Run;
use crate::TRACKS;
use crate::noise::disagreement;
use crate::peer_scene::without_maps;
use crate::pictures::{self, Pair, samples};
use crate::room::Room;
use crate::stage::{Stage, find};

/// Prints everything.
pub fn print(room: &Room, scored: &ResultFile, own: &[Run], theirs: &[Run]) {
    println!("\n| tool | stage | samples | CPU s | wall s |\n|---|---|---|---|---|");
    // A dataset brings its companions, which all submissions share.
    let (companions, own_stages): (Vec<Stage>, Vec<Stage>) =
        rows("ours", own).into_iter().partition(|stage| stage.name.contains("companions"));
    let their_stages = rows("theirs", theirs);
    let made = total(&companions);
    println!("\nOurs, companions of the dataset, made once: {:.1} CPU s ({:.1} s)", made.cpu, made.wall);
    println!(
        "\n| track | tool | samples | samples x variance of a pixel | samples x (dB of mean PSNR)^2 |\n|---|---|---|---|---|"
    );
    let scene = room.world.scene();
    let unmapped = ReferenceScene { lights: without_maps(scene), ..scene.clone() };
    let unmapped = World::new(Arc::new(unmapped)).unwrap();
    let factors = [0, 1].map(|track| compare(room, &unmapped, scored, track, theirs));
    println!(
        "\n| noise that is equal | fit | ours CPU s (wall) | theirs CPU s (wall) | ratio CPU | wall |\n|---|---|---|---|---|---|"
    );
    for (kind, name) in
        ["samples alike", "of a pixel", "of the mean PSNR", "bias of a plain PSNR"].into_iter().enumerate()
    {
        for with_fit in [true, false] {
            let ours = total(&own_stages);
            let counted = |stage: &&Stage| stage.name != "uncounted" && (with_fit || stage.name != "fit");
            let scaled = their_stages.iter().filter(counted).map(|stage| {
                let track = TRACKS.iter().position(|track| stage.name == format!("render {track}"));
                stage.times(track.map_or(1.0, |track| factors[track][kind]))
            });
            let theirs = total(&scaled.collect::<Vec<_>>());
            println!(
                "| {name} | {} | {:.1} ({:.1}) | {:.1} ({:.1}) | {:.1} | {:.1} |",
                if with_fit { "with" } else { "without theirs" },
                ours.cpu,
                ours.wall,
                theirs.cpu,
                theirs.wall,
                theirs.cpu / ours.cpu,
                theirs.wall / ours.wall
            );
        }
    }
}

/// Prints each run's stages and returns their means; the fit is scaled to all of its iterations.
fn rows(tool: &str, runs: &[Run]) -> Vec<Stage> {
    for stage in runs.iter().flat_map(|run| &run.stages) {
        println!("| {tool} | {} | {} | {:.2} | {:.2} |", stage.name, stage.samples, stage.cpu, stage.wall);
    }
    let mean = |first: &Stage| {
        let alike: Vec<&Stage> =
            runs.iter().flat_map(|run| &run.stages).filter(|stage| stage.name == first.name).collect();
        let sum = alike[1..].iter().fold(alike[0].clone(), |sum, stage| sum.plus(stage));
        let mean = sum.times(1.0 / alike.len() as f64);
        if first.name == "fit" { mean.scaled_to_iterations(ITERATIONS[0]) } else { mean }
    };
    runs[0].stages.iter().map(mean).collect()
}

fn total(stages: &[Stage]) -> Stage {
    stages[1..].iter().fold(stages[0].clone(), |sum, stage| sum.plus(stage))
}

/// Prints both tools' noise under the lights of a track and returns the factors for the times of their renders: for as
/// many samples as ours took, for our noise of a pixel and of the mean PSNR, and for the bias of a plain PSNR.
/// `unmapped` is the room with their lights.
fn compare(room: &Room, unmapped: &World, scored: &ResultFile, track: usize, theirs: &[Run]) -> [f64; 4] {
    let masks = pictures::masks(room, track);
    let name = format!("render {}", TRACKS[track]);
    let timed = find(&theirs[0].stages, &name, None).unwrap().samples;
    let noise = |tool: &str, pair: &Pair| {
        let noise = pictures::noise(room, pair, &masks, timed);
        println!("| {} | {tool} | {timed} | {:.4e} | {:.4e} |", TRACKS[track], noise.variance, noise.certified);
        noise
    };
    let blender = pictures::ours(room, &room.world, scored, track, PrincipledFlavour::Blender, timed);
    noise("ours as scored", &blender);
    let ours = pictures::ours(room, unmapped, scored, track, PrincipledFlavour::Mitsuba, timed);
    let own = noise("ours as theirs", &ours);
    let pair: Pair = [0, 1].map(|round| theirs[round].pictures[track].clone());
    let peers = noise("theirs", &pair);
    let exposure = room.scene.exposure as f32;
    let flat = |pair: &Pair| [0, 1].map(|k| pictures::flat(&pair[k], &masks, exposure));
    let apart = disagreement(flat(&ours), flat(&pair));
    println!("| {} | squared difference of the last two | linear, sRGB, means | {apart} |", TRACKS[track]);
    let plain = pictures::plain_samples(room, &pair, &masks, timed, scored, track);
    println!("| {} | a plain PSNR as near as ours is certified takes | {plain:.0} samples | | |", TRACKS[track]);
    let timed = f64::from(timed);
    let as_many = f64::from(2 * samples(scored)[track]);
    let noisier = [1.0, peers.variance / own.variance, peers.certified / own.certified];
    let [alike, pixel, mean_psnr] = noisier.map(|factor| factor * as_many / timed);
    [alike, pixel, mean_psnr, plain / timed]
}
