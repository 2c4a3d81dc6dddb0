//! Time of `g` and of `hessian` on a bubble of thousands of facets, per facet; with `fuzz SECONDS SEED`, random texts through the
//! reader and the interpreter for that long.
//!
//!     cargo bench --bench evolver
//!     cargo bench --bench evolver -- fuzz 600
//!
//! The same commands in Surface Evolver: `g 10` after five and six `r` of cube.fe; quote its user seconds.

#![allow(clippy::print_stdout, missing_docs, reason = "a benchmark prints")]

use combwright::evolver::{
    Document, parse_commands,
    session::{Host, Session},
    source::Source,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::{Duration, Instant};

const CUBE: &str = include_str!("../tests/support/cube.fe");

struct Silent;

impl Host for Silent {
    fn print(&mut self, _text: &str) {}

    fn write(&mut self, _name: &str, _text: &str, _append: bool) -> Result<(), std::io::Error> {
        Ok(())
    }

    fn interrupted(&self) -> bool {
        false
    }
}

fn session() -> Session {
    Session::new(Document::new(&Source::new("cube", CUBE)).expect("a sound file")).expect("a sound surface")
}

fn timed(session: &mut Session, commands: &str) -> f64 {
    let source = Source::new("bench", commands);
    let statements = parse_commands(&source).expect("sound commands");
    let began = Instant::now();
    session.run(&source, &statements, &mut Silent).expect("sound steps");
    began.elapsed().as_secs_f64()
}

fn speed() {
    for levels in [4, 5, 6] {
        let mut session = session();
        timed(&mut session, &"g 5; r; ".repeat(levels));
        let facets = session.surface().facets.len();
        timed(&mut session, "g 2");
        let g = timed(&mut session, "g 10") / 10.0;
        let hessian = timed(&mut session, "hessian");
        let per_facet = 1e6 / f64::from(u32::try_from(facets).unwrap_or(u32::MAX));
        println!("{facets} facets: g {:.4} s ({:.3} µs per facet), hessian {hessian:.3} s", g, g * per_facet);
    }
}

const WORDS: [&str; 86] = [
    "vertices",
    "edges",
    "faces",
    "bodies",
    "read",
    "constraint",
    "formula:",
    "content:",
    "c1:",
    "e1:",
    "parameter",
    "x",
    "y",
    "^",
    "1",
    "-3",
    "2.5e3",
    "1e999",
    "(",
    ")",
    "{",
    "}",
    "[",
    "]",
    ":=",
    "+=",
    ";",
    ",",
    ":",
    "?",
    "*",
    "/",
    "where",
    "foreach",
    "do",
    "if",
    "then",
    "else",
    "while",
    "for",
    "sum(",
    "max(",
    "edge",
    "vertex",
    "facet",
    "body",
    ".",
    "\"%d %g %s\\n\"",
    "printf",
    "g 1",
    "r",
    "u",
    "V",
    "hessian",
    "set",
    "#define A B",
    "A",
    "\n",
    "volume",
    "torus",
    "o",
    "O",
    "pop",
    "t1_edgeswap",
    "delete",
    "slide",
    "t 0.3",
    "w 0.2",
    "refine",
    "define zz real[2][3]",
    "zz",
    "zz[1][2]",
    "{{1,2},{3,4}}",
    "real",
    "integer",
    "local nn",
    "nn",
    "return",
    "procedure p1(real aa) { print aa }",
    "p1(",
    "function real f1(real bb) {",
    "f1(",
    "++",
    "--",
    "string",
    "space_dimension 2",
];

/// Commands that mutations change, beside the elements of the file.
const MUTATED: &str = "\
r; g 2; u; V; printf \"%g\", total_energy; hessian; define zz real[3][2]; zz[2][1] := 4; zz := 2*zz; print zz
function real ff(real aa) { local bb; bb := aa*2; if bb > 3 then return 1; return ff(bb) }
procedure pp(integer nn) { print ff(nn); for ( ii := 1; ii < nn; ii++ ) { zz[ii][1] += ii } }
pp(3); delete edge[5]; o; pop vertex; refine edge where length > 0.4; t 0.2
";

/// What mutations put in.
const LETTERS: &[u8] = b" 0123456789-+.*/()[]{};:=,\nabcdefgvx";

/// Random bytes, random words, and mutations of a sound file; a session runs what can be read.
fn fuzz(seconds: u64, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut count = 0_u64;
    let (mut slowest, mut slow_text) = (Duration::ZERO, String::new());
    while Instant::now() < end {
        let text = match count % 3 {
            0 => {
                let bytes: Vec<u8> =
                    (0..random.random_range(0..300)).map(|_| random.random_range(0..=255)).collect();
                String::from_utf8_lossy(&bytes).into_owned()
            }
            1 => (0..random.random_range(0..80))
                .map(|_| WORDS[random.random_range(0..WORDS.len())])
                .collect::<Vec<_>>()
                .join(" "),
            _ => {
                let mut bytes = format!("{CUBE}read\n{MUTATED}").into_bytes();
                for _ in 0..random.random_range(1..8) {
                    let at = random.random_range(0..bytes.len());
                    bytes[at] = LETTERS[random.random_range(0..LETTERS.len())];
                }
                String::from_utf8_lossy(&bytes).into_owned()
            }
        };
        count += 1;
        let began = Instant::now();
        let source = Source::new("fuzz", text.as_str());
        if let Ok(mut document) = Document::new(&source) {
            let commands = std::mem::take(&mut document.commands);
            if let Ok(mut session) = Session::new(document) {
                session.set_budget(200);
                let _ = session.run(&source, &commands, &mut Silent);
            }
        }
        if let Ok(statements) = parse_commands(&source) {
            let mut session = session();
            session.set_budget(50);
            let _ = session.run(&source, &statements, &mut Silent);
        }
        if began.elapsed() > slowest {
            (slowest, slow_text) = (began.elapsed(), text);
        }
    }
    println!("{count} texts in {seconds} s, the slowest took {:.3} s:\n{slow_text}", slowest.as_secs_f64());
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    match arguments.iter().position(|word| word == "fuzz") {
        Some(at) => {
            let number = |place: usize, default: u64| {
                arguments.get(place).and_then(|number| number.parse().ok()).unwrap_or(default)
            };
            fuzz(number(at + 1, 60), number(at + 2, 1));
        }
        None => speed(),
    }
}
