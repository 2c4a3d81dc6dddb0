//! T1s and pops of datafiles' surfaces, and the language's arrays, procedures and functions, against laws and against Surface
//! Evolver's own numbers.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "helpers of tests may fail by a panic, and say what they skip"
)]

#[path = "support/evolver.rs"]
mod support;

use combwright::evolver::session::Session;
use std::fmt::Write as _;
use support::{energy, run, shared};

/// Four cells of a 2 × 1 box that meet in two triple points, 0.2 apart.
const FOUR: &str = "STRING\nspace_dimension 2\nvertices\n\
    1 0 0 fixed\n2 2 0 fixed\n3 2 1 fixed\n4 0 1 fixed\n5 0.9 0.5\n6 1.1 0.5\n\
    edges\n1 1 5\n2 2 6\n3 3 6\n4 4 5\n5 5 6\n6 1 2 fixed\n7 2 3 fixed\n8 3 4 fixed\n9 4 1 fixed\n\
    faces\n1 6 2 -5 -1\n2 7 3 -2\n3 8 4 5 -3\n4 9 1 -4\nbodies\n1 1\n2 2\n3 3\n4 4\nread\n";

/// The same box with one point where four strings meet.
const CROSS: &str = "STRING\nspace_dimension 2\nvertices\n\
    1 0 0 fixed\n2 2 0 fixed\n3 2 1 fixed\n4 0 1 fixed\n5 1.05 0.5\n\
    edges\n1 1 5\n2 2 5\n3 3 5\n4 4 5\n6 1 2 fixed\n7 2 3 fixed\n8 3 4 fixed\n9 4 1 fixed\n\
    faces\n1 6 2 -1\n2 7 3 -2\n3 8 4 -3\n4 9 1 -4\nbodies\n1 1\n2 2\n3 3\n4 4\nread\n";

/// Four films on a line of two edges whose ends are fixed.
const FILMS: &str = include_str!("support/four_films.fe");

fn close(here: f64, known: f64, tolerance: f64, what: &str) {
    assert!((here / known - 1.0).abs() < tolerance, "{what}: {here} {known}");
}

fn total_volume(session: &mut Session) -> f64 {
    session.bodies().unwrap().iter().map(|body| body.volume).sum()
}

#[test]
fn a_t1_goes_as_surface_evolver_s_and_keeps_the_total_area() {
    let (mut session, _) = run(FOUR, "t1_edgeswap edge where length < 0.3").unwrap();
    close(session.values().unwrap().energy, 10.508_131_845_707_6, 1e-14, "swapped");
    close(total_volume(&mut session), 2.0, 1e-14, "total area");
    let areas: Vec<f64> = session.bodies().unwrap().iter().map(|body| body.volume).collect();
    for (here, known) in areas.iter().zip([0.4, 0.6, 0.4, 0.6]) {
        close(*here, known, 1e-14, "area");
    }
    // The cells that were apart have come together: a film of length 2 − 1/√3 upright, and four at 120 degrees to it.
    let here = energy(FOUR, "t1_edgeswap edge[5]; U; g 60");
    close(here, 10.472_135_954_999_6, 1e-12, "at rest");
    // The facets turned round: the same picture.
    let turned = FOUR.replace(
        "1 6 2 -5 -1\n2 7 3 -2\n3 8 4 5 -3\n4 9 1 -4",
        "1 1 5 -2 -6\n2 2 -3 -7\n3 3 -5 -4 -8\n4 4 -1 -9",
    );
    close(energy(&turned, "t1_edgeswap edge[5]"), 10.508_131_845_707_6, 1e-14, "turned");
}

#[test]
fn points_of_four_and_five_strings_pop_as_surface_evolver_s() {
    let (mut session, paper) = run(CROSS, "o").unwrap();
    assert!(paper.text.contains("popped: 1"), "{}", paper.text);
    close(session.values().unwrap().energy, 10.381_690_455_994_9, 1e-14, "popped");
    close(total_volume(&mut session), 2.0, 1e-14, "total area");
    let five = CROSS.replace("5 1.05 0.5\n", "5 1.05 0.5\n6 2.2 0.6 fixed\n");
    let five = five[..five.find("6 1 2 fixed").unwrap()].to_owned() + "5 6 5\n";
    close(energy(&five, "pop vertex[5]"), 5.515_622_897_963_2, 1e-14, "five strings");
    // Steiner's tree of the unit square.
    let square = "STRING\nvertices\n1 0 0 0 fixed\n2 1 0 0 fixed\n3 1 0 1 fixed\n4 0 0 1 fixed\n5 .5 0 .5\n\
        edges\n1 1 5\n2 2 5\n3 3 5\n4 4 5\n";
    close(energy(square, "o; g 5; U; g 60"), 1.0 + 3.0_f64.sqrt(), 1e-12, "Steiner's tree");
}

#[test]
fn t1s_of_a_foam_in_the_plane_go_as_surface_evolver_s() {
    let Some(text) = shared("foams/flat2d_64.fe") else { return };
    let (mut session, _) = run(&text, "t1_edgeswap edge where length < 0.25").unwrap();
    close(session.values().unwrap().energy, 122.558_837_549_399, 1e-13, "eight T1s");
    // Twice the same T1 is none: the foam comes back to where it was.
    let rest = "M 2; g 3; hessian; hessian; hessian; hessian";
    let none = energy(&text, rest);
    close(
        energy(&text, &format!("t1_edgeswap edge[7]; t1_edgeswap edge[7]; {rest}")),
        none,
        1e-10,
        "there and back",
    );
}

#[test]
fn lines_of_four_films_part_as_surface_evolver_s() {
    for (commands, known, counts) in
        [("O", 17.887_943_283_980_6, [20, 45, 26]), ("r; O", 17.891_639_939_862_1, [64, 165, 102])]
    {
        let (mut session, _) = run(FILMS, commands).unwrap();
        close(session.values().unwrap().energy, known, 1e-14, commands);
        let surface = session.surface();
        assert_eq!([surface.vertices.len(), surface.edges.len(), surface.facets.len()], counts, "{commands}");
    }
    let here = energy(FILMS, "O; g 20; r; g 20; U; g 100; U; hessian; hessian; hessian; hessian");
    close(here, 16.875_837_855_975_8, 1e-9, "at rest");
}

/// The cone over the edges of a box with its corners out of place, closed by the box's own fixed faces: six bodies meet at its
/// middle.
fn six_pyramids() -> String {
    let corners = [
        (-1.0, -1.2, -1.4),
        (1.1, -1.25, -1.35),
        (1.05, 1.3, -1.5),
        (-1.15, 1.2, -1.3),
        (-0.9, -1.1, 1.3),
        (1.2, -1.2, 1.45),
        (1.0, 1.1, 1.6),
        (-1.05, 1.35, 1.5),
    ];
    let sides =
        [(1, 2), (2, 3), (3, 4), (4, 1), (5, 6), (6, 7), (7, 8), (8, 5), (1, 5), (2, 6), (3, 7), (4, 8)];
    // Each face of the box by its sides, outward.
    let faces = [
        [-4, -3, -2, -1],
        [5, 6, 7, 8],
        [1, 10, -5, -9],
        [2, 11, -6, -10],
        [3, 12, -7, -11],
        [4, 9, -8, -12],
    ];
    let mut text = "vertices\n1 0.02 0.03 0.05\n".to_owned();
    for (at, (x, y, z)) in (2..).zip(corners) {
        let _ = writeln!(text, "{at} {x} {y} {z} fixed");
    }
    text += "edges\n";
    for (at, (a, b)) in (1..).zip(sides) {
        let _ = writeln!(text, "{at} {} {} fixed", a + 1, b + 1);
    }
    for corner in 1..=8 {
        let _ = writeln!(text, "{} 1 {}", 12 + corner, corner + 1);
    }
    text += "faces\n";
    for (at, (a, b)) in (1..).zip(sides) {
        let _ = writeln!(text, "{at} {} {at} -{}", 12 + a, 12 + b);
    }
    for (at, face) in (13..).zip(faces) {
        let _ = writeln!(text, "{at} {} {} {} {} fixed tension 0", face[0], face[1], face[2], face[3]);
    }
    text += "bodies\n";
    for (at, face) in (1..).zip(faces) {
        // A film's normal is right-handed to its side; the pyramid's face runs along the side, so that its films run against.
        let films: String = face.iter().map(|side: &i32| format!("{} ", -side)).collect();
        let _ = writeln!(text, "{at} {films}{}", 12 + at);
    }
    text
}

#[test]
fn a_point_of_eight_lines_opens_into_the_film_of_the_cube_s_frame() {
    let text = six_pyramids();
    let (mut closed, _) = run(&text, "").unwrap();
    let volume = total_volume(&mut closed);
    let (mut session, paper) = run(&text, "o").unwrap();
    assert!(paper.text.contains("Vertices popped: 1"), "{}", paper.text);
    close(total_volume(&mut session), volume, 1e-13, "total volume");
    for body in session.bodies().unwrap() {
        close(body.volume, body.closed.unwrap(), 1e-12, "a body is closed");
    }
    // At most three films meet at a line, and nothing is left to pop.
    let (_, paper) = run(&text, "o; o; print max(edge, valence)").unwrap();
    assert!(paper.text.ends_with("Edges popped: 0\nVertices popped: 0\n3\n"), "{}", paper.text);
    // Surface Evolver's film in the same frame, refined, tends to 25.2433; its mesh there is another.
    let here = energy(
        &text,
        "o; g 20; r; g 20; u; V; u; V; t 0.05; g 50; r; g 20; u; V; u; V; U; g 100; U; M 2; g 20; hessian_seek; hessian_seek",
    );
    close(here, 25.2433, 4e-5, "at rest");
}

#[test]
fn deleting_edges_deletes_all_of_them() {
    let strings = "STRING\nspace_dimension 2\nvertices\n1 0 0 fixed\n2 1 0\n3 1.01 0\n4 2 0\n5 2.01 0\n6 3 0 fixed\n\
        edges\n1 1 2\n2 2 3\n3 3 4\n4 4 5\n5 5 6\n";
    let (session, _) = run(strings, "delete edge where length < 0.1").unwrap();
    assert_eq!(session.surface().edges.len(), 3);
    assert_eq!(session.surface().vertices.len(), 4);
}

/// Definitions in the datafile's head, as in the manual.
const LANGUAGE: &str = "STRING\nspace_dimension 2\n\
    define qq real[2][3] = {{1,2},{3,4,5}}\n\
    define vertex attribute ww real[2][2]\n\
    function real ff(real aa, real bb) { local cc; cc := aa + bb; if cc > 3 then return cc^2; return cc; }\n\
    procedure pshow(real aa) { printf \"show %g %g\\n\", aa, ff(aa,aa); }\n\
    vertices\n1 0 0 fixed\n2 1 0 fixed\nedges\n1 1 2\nread\n";

#[test]
fn arrays_procedures_and_functions_compute_as_in_surface_evolver() {
    // Each command with what Surface Evolver 2.70 prints, but for its spaces in arrays.
    let script = [
        ("print qq", "{{1, 2, 0}, {3, 4, 5}}\n"),
        ("print qq[2]", "{3, 4, 5}\n"),
        ("qq[1][3] := 7; qq[2][1] += 2; print qq", "{{1, 2, 7}, {5, 4, 5}}\n"),
        (
            "define zz real[2][2]; zz := {{1,2},{3,4}}; define yy real[2][2]; yy := zz*zz; print yy",
            "{{7, 10}, {15, 22}}\n",
        ),
        ("yy := 2*zz; yy := yy - zz; print yy", "{{1, 2}, {3, 4}}\n"),
        ("yy := 5; print yy", "{{5, 5}, {5, 5}}\n"),
        ("define bb integer[3]; bb := {1.5,2.9,-3.9}; print bb", "{1, 2, -4}\n"),
        ("define aa real[3]; aa := {1,2,3}; print aa*aa; printf \"%g\\n\", sizeof(qq)", "14\n6\n"),
        ("pshow(3); pshow(1)", "show 3 36\nshow 1 2\n"),
        ("vertex[1].ww[1][2] := 3; print vertex[1].ww; print vertex[1].ww[1][2]", "{{0, 3}, {0, 0}}\n3\n"),
        ("print ff(1,1) + ff(2,2)", "18\n"),
        ("for ( inx := 1; inx <= 3; inx++ ) { aa[inx] := ff(inx, 0); }; print aa", "{1, 2, 3}\n"),
        ("define aa real[5]; print aa; print aa[2]", "{1, 2, 3, 0, 0}\n2\n"),
        ("foreach vertex vv do { local ss; ss := vv.x; printf \"%g\\n\", ss; }", "0\n1\n"),
        (
            "procedure fact(integer nn) { local mm; mm := nn; if nn > 1 then fact(nn-1); printf \"%g %g\\n\", nn, mm; }\n\
             fact(3)",
            "1 1\n2 2\n3 3\n",
        ),
        (
            "function real fib(integer nn) { if nn < 2 then return nn; return fib(nn-1) + fib(nn-2); }\nprint fib(12)",
            "144\n",
        ),
        ("vertex[1].ww := {{1,2},{3,4}}; print vertex[1].ww", "{{1, 2}, {3, 4}}\n"),
    ];
    let commands: Vec<&str> = script.iter().map(|(command, _)| *command).collect();
    let (_, paper) = run(LANGUAGE, &commands.join("\n")).unwrap();
    let told: String = script.iter().map(|(_, told)| *told).collect();
    assert_eq!(paper.text, told);
}

#[test]
fn wrong_uses_of_arrays_and_procedures_are_said() {
    for (commands, words) in [
        ("qq[3][1] := 1", "there is no qq[3][1]: the sizes of qq are [2, 3]"),
        ("print qq + 1", "arrays are added"),
        ("define zz real[1000000][1000000]", "at most"),
        ("x1 := qq", "«qq» is an array"),
        ("pshow(1, 2)", "pshow takes 1 arguments, 2 are given"),
        ("procedure again() { again() }\nagain()", "without end"),
        ("function real none(real aa) { aa := 1; }\nprint none(1)", "ended without «return»"),
        ("local hidden; procedure p1() { print hidden }\np1()", "«hidden» is not defined"),
        ("define tt string[3]", "not supported: an array of texts"),
        ("nothing[2] := 1", "«nothing» is no array"),
    ] {
        match run(LANGUAGE, commands) {
            Ok(_) => panic!("{commands}: no error"),
            Err(error) => assert!(error.to_string().contains(words), "{commands}: {error}"),
        }
    }
}

#[test]
fn energies_of_refinements_are_told_with_their_limit() {
    let cube = include_str!("support/cube.fe");
    let (_, told) = run(cube, "quiet on; g 5; r; g 5; r; g 5; e; gogo := { u }; list procedures").unwrap();
    // As Surface Evolver prints them.
    for words in ["refinement: 1  energy:   4.90749027", "extrapolation:   4.8361812", "procedure gogo"] {
        assert!(told.text.contains(words), "{}", told.text);
    }
}
