//! The program `mateval`.

fn main() -> std::process::ExitCode {
    mateval_cli::main(std::env::args_os()).into()
}
