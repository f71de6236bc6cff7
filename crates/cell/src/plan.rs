//! What a cell costs and whether it can be built: the model of the paper, its table as a file.
//!
//! In:  a TOML file: limits, cost factors, load of a controller, configurations. Out: cost, load and what stands against each; the
//! cheapest configuration for a number of axes.
//!
//! A cell of `axes` has `controllers`, each with `boards_per_controller` boards of `axes_per_board` axes. Its cost is
//! `controllers * (controller + board * boards_per_controller)`.

use serde::{Deserialize, Serialize};

/// Configurations of a file at the most.
const CONFIGURATIONS_MAX: usize = 10_000;
/// Axes that are asked for at the most.
pub const AXES_MAX: u32 = 65_536;

/// The file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// What cannot be exceeded.
    pub limits: Limits,
    /// Cost factors; of a configuration: its cost.
    pub cost: Cost,
    /// What a cycle takes.
    pub load: Load,
    #[serde(default, rename = "configuration")]
    /// What is to be judged.
    pub configurations: Vec<Configuration>,
}

/// What cannot be exceeded.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Axes of a board.
    pub axes_per_board: u32,
    /// Boards of a controller.
    pub boards_per_controller: u32,
    /// Controllers of the cell.
    pub controllers: u32,
}

/// Cost factors.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// Of a controller.
    pub controller: f64,
    /// Of a board.
    pub board: f64,
}

/// What a cycle takes in a controller, us: `base + axes * axis`, of `cycle`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// What it takes without an axis, us.
    pub base_us: f64,
    /// What each axis adds, us.
    pub axis_us: f64,
    /// Period of the cycle, us.
    pub cycle_us: f64,
}

/// A way to build a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Configuration {
    /// Axes of the cell.
    pub axes: u32,
    /// Axes of a board.
    pub axes_per_board: u32,
    /// Controllers of the cell.
    pub controllers: u32,
    /// Boards of a controller.
    pub boards_per_controller: u32,
    /// Cost as it was printed elsewhere, to be compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub printed_cost: Option<f64>,
}

/// What one comes to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    #[serde(flatten)]
    /// The configuration.
    pub configuration: Configuration,
    /// Boards of all controllers.
    pub boards: u32,
    /// Cost factors; of a configuration: its cost.
    pub cost: f64,
    /// Of a controller's cycle.
    pub load_percent: f64,
    /// Why it cannot be built.
    pub against: Vec<String>,
}

impl Model {
    /// Reads the file.
    ///
    /// # Errors
    /// It is none, with line and column; or a number of it cannot be.
    pub fn read(text: &str) -> Result<Model, String> {
        let model: Model = toml::from_str(text).map_err(|error| error.to_string())?;
        let Limits {
            axes_per_board,
            boards_per_controller,
            controllers,
        } = model.limits;
        for (key, value, max) in [
            ("limits.axes_per_board", axes_per_board, 64),
            ("limits.boards_per_controller", boards_per_controller, 64),
            ("limits.controllers", controllers, 4096),
        ] {
            if !(1..=max).contains(&value) {
                return Err(format!("{key} = {value}: must be 1 to {max}"));
            }
        }
        let Load {
            base_us,
            axis_us,
            cycle_us,
        } = model.load;
        for (key, value) in [
            ("cost.controller", model.cost.controller),
            ("cost.board", model.cost.board),
            ("load.base_us", base_us),
            ("load.axis_us", axis_us),
        ] {
            if !(0.0..=1e9).contains(&value) {
                return Err(format!("{key} = {value}: must be 0 to 1e9"));
            }
        }
        if !(1.0..=1e9).contains(&cycle_us) {
            return Err(format!("load.cycle_us = {cycle_us}: must be 1 to 1e9"));
        }
        match model.configurations.len() {
            0..=CONFIGURATIONS_MAX => Ok(model),
            count => Err(format!("{count} configurations, and {CONFIGURATIONS_MAX} are the most")),
        }
    }

    /// What a configuration comes to.
    pub fn judge(&self, configuration: &Configuration) -> Judged {
        let Configuration {
            axes,
            axes_per_board,
            controllers,
            boards_per_controller,
            ..
        } = *configuration;
        let per_controller = u64::from(boards_per_controller).saturating_mul(u64::from(axes_per_board));
        let room = u64::from(controllers).saturating_mul(per_controller);
        let load_us = self.load.base_us + self.load.axis_us * per_controller as f64;
        let load_percent = 100.0 * load_us / self.load.cycle_us;
        let mut against = Vec::new();
        let mut most = |what: &str, is: u32, max: u32| {
            if is == 0 || is > max {
                against.push(format!("{is} {what}, 1 to {max} are possible"));
            }
        };
        most("axes of a board", axes_per_board, self.limits.axes_per_board);
        most(
            "boards of a controller",
            boards_per_controller,
            self.limits.boards_per_controller,
        );
        most("controllers", controllers, self.limits.controllers);
        if room < u64::from(axes) {
            against.push(format!("{room} axes, {axes} are wanted"));
        }
        if load_percent > 100.0 {
            against.push(format!("a cycle takes {load_us:.0} us of {:.0}", self.load.cycle_us));
        }
        Judged {
            configuration: configuration.clone(),
            boards: controllers.saturating_mul(boards_per_controller),
            cost: f64::from(controllers) * (self.cost.controller + self.cost.board * f64::from(boards_per_controller)),
            load_percent,
            against,
        }
    }

    /// The cheapest configuration for so many axes, of those that cost the same the one with the fewest controllers; `None`: there is
    /// none.
    pub fn cheapest(&self, axes: u32) -> Option<Judged> {
        let mut best: Option<Judged> = None;
        for boards_per_controller in 1..=self.limits.boards_per_controller {
            for axes_per_board in 1..=self.limits.axes_per_board {
                let one = Configuration {
                    axes,
                    axes_per_board,
                    controllers: axes.div_ceil(boards_per_controller * axes_per_board),
                    boards_per_controller,
                    printed_cost: None,
                };
                let judged = self.judge(&one);
                let rank = |judged: &Judged| (judged.cost, f64::from(judged.configuration.controllers));
                if judged.against.is_empty() && best.as_ref().is_none_or(|best| rank(&judged) < rank(best)) {
                    best = Some(judged);
                }
            }
        }
        best
    }
}

/// As a table for people.
pub fn table(all: &[Judged]) -> String {
    // 80 columns, as far as nothing stands against it.
    let mut text = String::from("axes  axes/board  boards  controllers  on each    cost  printed    load  against\n");
    for judged in all {
        let Configuration {
            axes,
            axes_per_board,
            controllers,
            boards_per_controller,
            printed_cost,
        } = judged.configuration;
        let printed = printed_cost.map_or_else(|| "-".into(), |cost| cost.to_string());
        let line = format!(
            "{axes:4}  {axes_per_board:10}  {:6}  {controllers:11}  {boards_per_controller:7}  {:6}  {printed:>7}  {:4.1} %  {}",
            judged.boards,
            judged.cost,
            judged.load_percent,
            judged.against.join("; "),
        );
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PAPER: &str = include_str!("../../../configs/cell-cost.toml");

    #[test]
    fn the_table_of_the_paper_is_what_the_model_says() {
        let model = Model::read(PAPER).unwrap();
        assert_eq!(model.configurations.len(), 16);
        let judged: Vec<Judged> = model.configurations.iter().map(|one| model.judge(one)).collect();
        for one in &judged {
            assert_eq!(one.against, Vec::<String>::new(), "{one:?}");
        }
        let text = table(&judged);
        assert!(
            text.lines().all(|line| line.len() <= 80 && line == line.trim_end()),
            "{text}"
        );
        // Rows with one board in all are printed with 2, where the model gives 3.
        let others: Vec<(u32, f64)> = judged
            .iter()
            .filter(|one| one.configuration.printed_cost != Some(one.cost))
            .map(|one| (one.boards, one.cost))
            .collect();
        assert_eq!(others, [(1, 3.0); 4]);
        assert_eq!(judged.last().unwrap().cost, 384.0);
    }

    /// What the file says of the rows that differ: no weights of controllers and boards give all that is printed.
    #[test]
    fn no_weights_give_the_printed_cost_of_one_board() {
        let model = Model::read(PAPER).unwrap();
        let printed = |boards: u32| {
            let of_one = |one: &&Configuration| one.controllers == 1 && one.boards_per_controller == boards;
            let mut costs = model
                .configurations
                .iter()
                .filter(of_one)
                .map(|one| one.printed_cost.unwrap());
            let cost = costs.next().unwrap();
            assert!(costs.all(|other| other == cost), "{boards} boards");
            cost
        };
        // Of one controller, each board would add the same.
        let (second, third_and_fourth) = (printed(2) - printed(1), printed(4) - printed(2));
        assert_eq!((second, third_and_fourth), (2.0, 2.0));
        let mut single_boards = model.configurations.iter().filter(|one| one.boards_per_controller == 1);
        assert!(single_boards.all(|one| one.controllers == 1), "nothing else could tell");
    }

    #[test]
    fn the_cheapest_has_as_few_controllers_as_will_do() {
        let model = Model::read(PAPER).unwrap();
        let cheapest = |axes| {
            model
                .cheapest(axes)
                .map(|one| (one.configuration.controllers, one.boards, one.cost))
        };
        assert_eq!(cheapest(1), Some((1, 1, 3.0)));
        assert_eq!(cheapest(16), Some((1, 4, 6.0)));
        assert_eq!(cheapest(4000), Some((250, 1000, 1500.0)));
        assert_eq!(cheapest(4097), None);
        let mut slow = model.clone();
        slow.load.cycle_us = 130.0;
        // 8 + 8 * 14 = 120 us are possible, 9 axes are not.
        assert_eq!(slow.cheapest(16).unwrap().configuration.controllers, 2);
    }

    #[test]
    fn what_cannot_be_is_told() {
        let model = Model::read(PAPER).unwrap();
        let judged = model.judge(&Configuration {
            axes: 100,
            axes_per_board: 5,
            controllers: 1,
            boards_per_controller: 4,
            printed_cost: None,
        });
        assert_eq!(
            judged.against,
            ["5 axes of a board, 1 to 4 are possible", "20 axes, 100 are wanted"]
        );
        let error = Model::read(&PAPER.replace("board = 1", "bord = 1")).unwrap_err();
        assert!(
            error.contains("unknown field `bord`") && error.contains("line"),
            "{error}"
        );
        let error = Model::read(&PAPER.replace("controllers = 256", "controllers = 0")).unwrap_err();
        assert_eq!(error, "limits.controllers = 0: must be 1 to 4096");
    }

    proptest! {
        #[test]
        fn no_file_panics(text in "\\PC{0,200}", axes in 0u32..=u32::MAX, boards: u32, controllers: u32) {
            let _ = Model::read(&text);
            let model = Model::read(PAPER).unwrap();
            let _ = model.judge(&Configuration { axes, axes_per_board: axes, controllers, boards_per_controller: boards, printed_cost: None });
            let _ = model.cheapest(axes);
        }
    }
}
