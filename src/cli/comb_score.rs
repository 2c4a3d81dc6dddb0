//! `combwright comb score`: a table of cells against a truth.

use super::CliError;
use crate::comb::{self, Truth};
use anyhow::Context;
use std::{fs::File, path::PathBuf};

/// What was typed after `comb score`.
#[derive(Debug, clap::Args)]
pub(super) struct ScoreArguments {
    /// The cells.csv to judge
    cells: PathBuf,
    /// The truth.csv: x_px, y_px, sides, complete
    truth: PathBuf,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &ScoreArguments) -> Result<(), CliError> {
    let open = |path: &PathBuf| {
        File::open(path).with_context(|| format!("cannot open {}", path.display())).map_err(CliError::mistake)
    };
    let cells = comb::read_cells(open(&arguments.cells)?)
        .with_context(|| arguments.cells.display().to_string())
        .map_err(CliError::mistake)?;
    let truth = Truth::read(open(&arguments.truth)?)
        .with_context(|| arguments.truth.display().to_string())
        .map_err(CliError::mistake)?;
    let score = comb::score(&cells, &truth);
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&score).map_err(CliError::failure)?);
        return Ok(());
    }
    println!("true cells, complete  {:8}", score.truth_complete);
    println!("recall                {:8.4}", score.recall);
    println!("precision             {:8.4}", score.precision);
    println!("sides right           {:8.4}   of those reported complete", score.sides_right);
    println!("coverage              {:8.4}   of {} cells of known sides", score.coverage, score.counted);
    println!("defect recall         {:8.4}   of {}", score.defect_recall, score.defects);
    println!("defect precision      {:8.4}   of {}", score.defect_precision, score.defect_claims);
    println!("right when 90 % sure  {:8.4}   of {}", score.sure_right, score.sure);
    for wrong in &score.wrong {
        let said = wrong.said.map_or_else(|| "nothing".to_owned(), |n| n.to_string());
        println!("wrong at ({:.1}, {:.1}): {} sides, said {said}", wrong.x_px, wrong.y_px, wrong.sides);
    }
    Ok(())
}
