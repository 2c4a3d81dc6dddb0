//! Commands that tell of the session: energies by refinement, variables, procedures.

use super::{Host, Session, format::significant, motion::Done};
use std::fmt::Write as _;

impl Session {
    /// `e`: the energy before each refinement and now, and from three of them the limit of a geometric series.
    pub(super) fn extrapolate(&mut self, host: &mut dyn Host) -> Done {
        let mut energies = self.levels.clone();
        energies.push(self.values()?.energy);
        let mut text = String::new();
        for (at, energy) in energies.iter().enumerate() {
            // Writing to a string does not fail.
            let _ = write!(text, "refinement: {at}  energy: {:>19}", significant(*energy, 16));
            if let Some([before, last]) =
                at.checked_sub(2).map(|first| [energies[first], energies[first + 1]])
            {
                let (step, former) = (energy - last, last - before);
                let limit = energy - step * step / (step - former);
                let _ = write!(text, "  extrapolation: {:>19}", significant(limit, 16));
            }
            text.push('\n');
        }
        host.print(&text);
        Ok(())
    }

    /// `A`: the variables.
    pub(super) fn list_variables(&self, host: &mut dyn Host) {
        let mut text = "Variables:\n".to_owned();
        for (name, value) in self.variables.iter() {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{name:>32}  {}", significant(value, 15));
        }
        for (name, value) in &self.texts {
            let _ = writeln!(text, "{name:>32}  {value}");
        }
        host.print(&text);
    }

    /// `list procedures`; of other things there is nothing to list.
    pub(super) fn list_information(&self, what: &str, host: &mut dyn Host) {
        match what {
            "procedures" => {
                let mut text = String::new();
                for (name, known) in &self.routines {
                    let kind = if known.is_function() { "function" } else { "procedure" };
                    // Writing to a string does not fail.
                    let _ = writeln!(text, "{kind} {name}");
                }
                host.print(&text);
            }
            "variables" => self.list_variables(host),
            _ => {}
        }
    }
}
