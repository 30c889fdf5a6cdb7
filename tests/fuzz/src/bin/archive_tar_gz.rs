#![no_main]
//! Unpacks a tar, which is compressed first if it is not a gzip: nothing may be written outside its folder.

use std::io::Write as _;

use libfuzzer_sys::fuzz_target;
use mateval_submission::archive::unpack_tar_gz;

fuzz_target!(|bytes: &[u8]| {
    let packed = if bytes.starts_with(&[0x1f, 0x8b]) { bytes.to_vec() } else { gzip(bytes) };
    mateval_fuzz::with_file("a.tar.gz", &packed, |path| {
        let around = path.parent().expect("the file lies in a folder");
        let folder = around.join("unpacked");
        std::fs::create_dir(&folder).expect("the folder is new");
        let file = std::fs::File::open(path).expect("the file was just written");
        let _ = unpack_tar_gz(file, &folder);
        assert_eq!(std::fs::read_dir(around).expect("it is still there").count(), 2);
    });
});

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
    packed.write_all(bytes).and_then(|()| packed.finish()).expect("a vector takes everything")
}
