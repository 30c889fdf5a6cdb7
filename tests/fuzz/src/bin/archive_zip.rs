#![no_main]
//! Unpacks a zip: nothing may be written outside its folder.

use libfuzzer_sys::fuzz_target;
use mateval_submission::archive::unpack_zip;

fuzz_target!(|bytes: &[u8]| {
    mateval_fuzz::with_file("a.zip", bytes, |path| {
        let around = path.parent().expect("the file lies in a folder");
        let folder = around.join("unpacked");
        std::fs::create_dir(&folder).expect("the folder is new");
        let file = std::fs::File::open(path).expect("the file was just written");
        let _ = unpack_zip(file, &folder);
        assert_eq!(std::fs::read_dir(around).expect("it is still there").count(), 2);
    });
});
