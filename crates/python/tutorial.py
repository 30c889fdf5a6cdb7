"""A first submission, from a dataset to its scores: ``python tutorial.py DATASET OUT``.

Any dataset works. The built-in one takes two minutes::

    mateval demo --out demo
    python tutorial.py demo/dataset first

Needs the package ``mateval`` and nothing else.
"""

import argparse

import numpy as np

import mateval


def describe(scene):
    """Prints what a method gets: the photo, and the geometry of every view."""
    width, height = scene.input.camera.size
    print(f"{scene.id}: {len(scene.instances)} instances, a photo of {width} x {height}")
    for view in scene.views.values():
        # World points of this view's pixels, in metres, projected to the photo.
        points = view.camera.unproject(view.depth)
        pixels, _ = scene.input.camera.project(points)
        inside = ((pixels >= 0) & (pixels < (width, height))).all(axis=-1)  # False where a pixel shows no surface
        print(
            f"  {view.id}: {inside.mean():.0%} of the pixels lie within the photo's frame; "
            f"{view.unobserved.mean():.1%} show surfaces that the photo does not"
        )


def estimate(photo):
    """A stand-in for your network: (height, width, 3), linear radiance in, linear albedo out.

    It returns the photo as the albedo, scaled so that 99 of 100 values are below 0.8. The shadows and the light's colour
    remain in it, so it scores badly.
    """
    return np.clip(photo * (0.8 / np.percentile(photo, 99)), 0.0, 1.0)


def submit(dataset, out):
    """Writes a submission: an atlas for each instance of each scene. It is complete, or it does not exist."""
    description = "the photo itself as albedo"
    with mateval.Submission(out, dataset, method="tutorial", description=description, force=True) as submission:
        for scene in dataset.values():
            # Texels that the photo does not show take the value of the nearest one that it shows. A method with atlases
            # of its own writes them directly; instances that it leaves out are scored as missing.
            for instance, maps in mateval.lift(scene, base_color=estimate(scene.input.rgb)).items():
                # Roughness and metallic that are not written are scored as missing too.
                submission.write(scene.id, instance, base_color=maps.base_color)


def quick_check(dataset):
    """Compares the estimate with the truth in the input view, which takes no rendering. PSNR in dB.

    Returns whether the dataset holds its truth.
    """
    for scene in dataset.values():
        view = scene.input
        try:
            truth = view.truth.albedo
        except mateval.Withheld:
            print(f"{scene.id}: the truth is withheld; only the dataset's keeper can score")
            return False
        print(f"{scene.id}: {mateval.metrics.psnr(estimate(view.rgb), truth, view.valid):.1f} dB of linear albedo")
    return True


def main():
    parser = argparse.ArgumentParser(description="write and score a first submission")
    parser.add_argument("dataset", help="folder of a dataset")
    parser.add_argument("out", help="folder of the submission, replaced if it exists")
    words = parser.parse_args()

    dataset = mateval.open(words.dataset)
    for scene in dataset.values():
        describe(scene)
    submit(dataset, words.out)
    has_truth = quick_check(dataset)

    # Faults of a submission, each with what to do. This needs no truth and takes seconds.
    report = mateval.lint(words.out, dataset)
    print(report)
    if not report.good:
        raise SystemExit("fix the submission before it is scored")

    if not has_truth:
        return

    # The scores take a minute for each scene: the submission is rendered in every view.
    result = mateval.score(words.out, dataset)
    print("albedo PSNR, dB:")
    for views in ("input", "novel", "unobserved"):
        print(f"  {views}: {result[f'albedo.{views}.psnr']:.2f}")
    # The same after the best factor for each channel of a picture, which no method can know from a photo.
    print(f"  novel, aligned: {result['albedo_aligned.novel.psnr']:.2f}")
    print(f"PSNR of the pictures under the true light, novel views: {result['rgb_true.novel.psnr']:.2f}")
    # What `mateval eval` takes, such as `mateval eval explain` for the scene with the worst albedo.
    with open(f"{words.out}.json", "w") as file:
        file.write(result.json)
    worst = min(result.scenes, key=lambda scene: result.scenes[scene]["albedo.novel.psnr"])
    print(f"the worst scene is {worst}; this shows where its albedo is wrong:")
    print(f"  mateval eval explain {words.out}.json --scene {worst} --dataset {words.dataset} --submission {words.out}")
    # Numbers of different fingerprints must not be compared.
    print(f"fingerprint {result.fingerprint[:12]}, {len(result.to_records())} single values")


if __name__ == "__main__":
    try:
        main()
    except mateval.Error as error:
        raise SystemExit(f"error: {error}") from None
