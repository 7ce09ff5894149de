//! `lab effects`: the catalogue.

use clap::ValueEnum;
use lab::report::effects::{card, cards, find, list};

use super::{Answer, Format, print};

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// One effect, as `id` or `system/id`; all when left out.
    id: Option<String>,
    /// Only effects of this system.
    #[arg(long, value_enum)]
    system: Option<System>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum System {
    Battery,
    Robot,
    Station,
}

impl From<System> for energy::System {
    fn from(system: System) -> energy::System {
        match system {
            System::Battery => energy::System::Battery,
            System::Robot => energy::System::Robot,
            System::Station => energy::System::Station,
        }
    }
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    let cards = cards(args.system.map(Into::into));
    match &args.id {
        None => print(format, &cards, || list(&cards))?,
        Some(id) => {
            let one = find(&cards, id)?;
            print(format, one, || card(one))?;
        }
    }
    Ok(Answer::Yes)
}
