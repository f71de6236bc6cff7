//! `addf`: the order in which components run.
//!
//! In:  functions and where they are to stand in a thread. Out: the instances in that order, before or after motion.

use super::{Instance, Translator, name_here, period_text};
use crate::hal_import::Refused;
use components::find;

impl Translator<'_> {
    pub(super) fn add_function(&mut self, function: &str, thread: &str, position: Option<&&str>, at: usize) {
        let function = self.pin_here(function);
        let is_motion = ["motion-command-handler", "motion-controller"].contains(&function.as_str());
        if !is_motion && self.of_function(&function).is_empty() {
            return self.refuse(at, self.no_function(&function));
        }
        match self.threads.get(thread) {
            Some(period_ns) if *period_ns != self.own.cycle_ns => {
                let (there, here) = (period_text(*period_ns), period_text(self.own.cycle_ns));
                self.refuse(
                    at,
                    format!("{thread} runs every {there}, here it runs once a cycle of {here}: convert what counts its calls"),
                );
            }
            None if thread.starts_with("base") || thread.starts_with("fast") => {
                self.refuse(at, format!("there is no {thread}: it runs once a cycle"));
            }
            _ => {}
        }
        if is_motion {
            self.needless += 1;
        }
        let count = self.functions.len();
        let index = match position.and_then(|position| position.parse::<i64>().ok()) {
            Some(place @ 1..) => (usize::try_from(place).unwrap_or(count) - 1).min(count),
            Some(place @ ..=-1) => (count + 1).saturating_sub(usize::try_from(-place).unwrap_or(0)),
            Some(0) | None => count,
        };
        self.functions.insert(index, (function, at));
    }

    /// Instances that a function updates: `and2.0`, `pid.0.do-pid-calcs`, or `encoder.update-counters` for all of a kind.
    fn of_function(&self, function: &str) -> Vec<usize> {
        let all = self.instances.iter().enumerate();
        all.filter(|(_, instance)| functions(instance).iter().any(|known| known == function))
            .map(|(at, _)| at)
            .collect()
    }

    /// Why there is no such function.
    fn no_function(&self, function: &str) -> String {
        let module = function.split('.').next().unwrap_or_default();
        let is_of = |instance: &Instance| instance.made.name == module || name_here(instance.kind.name) == module;
        if !self.instances.iter().any(is_of) && find(module).is_none() {
            return "a function of a module that was not translated".to_owned();
        }
        let known: Vec<String> = self.instances.iter().flat_map(functions).collect();
        let near = hal_pins::nearest(function, known.iter().map(String::as_str));
        let hint = near.map_or(String::new(), |near| format!("; {near} is the nearest"));
        format!("no loadrt makes a function {function}{hint}")
    }

    /// Puts the instances in the order of their functions; those behind the motion controller run after motion.
    pub(super) fn place_functions(&mut self) {
        let motion = self
            .functions
            .iter()
            .position(|(function, _)| function == "motion-controller");
        let mut order: Vec<(usize, bool)> = Vec::new();
        let mut again = Vec::new();
        for (number, (function, at)) in self.functions.iter().enumerate() {
            let after = motion.is_some_and(|motion| number > motion);
            for instance in self.of_function(function) {
                match order.iter().find(|(known, _)| *known == instance) {
                    None => order.push((instance, after)),
                    Some((_, before)) if *before != after => again.push(*at),
                    Some(_) => {}
                }
            }
        }
        for at in again {
            self.refuse(
                at,
                "all functions of a component run in one call here, where the first one stands",
            );
        }
        let mut instances: Vec<Option<Instance>> = std::mem::take(&mut self.instances).into_iter().map(Some).collect();
        for (at, after) in order {
            let Some(mut instance) = instances[at].take() else {
                continue;
            };
            instance.made.after_motion = after;
            self.instances.push(instance);
        }
        for instance in instances.into_iter().flatten() {
            let name = instance.made.name.clone();
            let place = instance.place.clone();
            self.instances.push(instance);
            self.refused.push(Refused {
                place,
                text: name,
                why: "no addf adds it to a thread: put it where it is to run; it stands last".to_owned(),
            });
        }
    }
}

/// Functions that update an instance, by their names there: most kinds have one of the instance's own name, some one for all instances.
fn functions(instance: &Instance) -> Vec<String> {
    let Instance { made, kind, .. } = instance;
    let own = |names: &[&str]| -> Vec<String> { names.iter().map(|name| format!("{}.{name}", made.name)).collect() };
    let of_all = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
    match kind.name {
        "pid" => own(&["do-pid-calcs"]),
        "siggen" => own(&["update"]),
        "gantry" => own(&["read", "write"]),
        "encoder" => of_all(&["encoder.update-counters", "encoder.capture-position"]),
        "counter" => of_all(&["counter.update-counters", "counter.capture-position"]),
        "watchdog" => of_all(&["watchdog.process", "watchdog.set-timeouts"]),
        "sim_encoder" => of_all(&["sim-encoder.make-pulses", "sim-encoder.update-speed"]),
        "weighted_sum" => of_all(&["process-wsums"]),
        _ => vec![made.name.clone()],
    }
}
