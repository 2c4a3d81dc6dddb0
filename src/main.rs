//! The program `combwright`. Everything is in the library; [`combwright::cli`] reads the arguments.

fn main() -> std::process::ExitCode {
    combwright::cli::main()
}
