//! Methods about programs in Structured Text.

use super::{Call, Methods, arguments, value};
use crate::errands::Errand;
use crate::orders::Order;
use crate::rpc::{RpcError, code};
use crate::server::Ticket;
use protocol::{
    Forced, LogicForced, LogicReleased, LogicReloaded, LogicRole, LogicTasks, LogicVariable, LogicVariables,
};
use rt::logic::Replaced;
use serde_json::Value;
use std::sync::Arc;

/// Variables in an answer.
const VARIABLES_PER_PAGE: usize = 500;

impl Methods {
    /// What is forced, for everybody to see.
    pub(super) fn forced(&self) -> Vec<Forced> {
        let all = self.logic.forced().into_iter();
        all.map(|(program, forced)| Forced {
            program: program.to_string(),
            variable: forced.variable,
            value: forced.value,
        })
        .collect()
    }

    pub(super) fn logic_tasks(&self) -> LogicTasks {
        let tasks = self.logic.told().into_iter().map(|told| protocol::LogicTask {
            name: told.name,
            file: told.file,
            period_ms: told.period_ms,
            steps_max: told.steps_max,
            scans: told.scans,
            overruns: told.overruns,
            overflows: told.overflows,
            scan_us: told.scan_us,
            scan_max_us: told.scan_max_us,
            stands: told.stands,
            forced: told.forced,
        });
        LogicTasks {
            programs: tasks.collect(),
        }
    }

    /// The program that a call means.
    pub(super) fn logic_task(&self, call: &Call<'_>) -> Result<usize, RpcError> {
        let name = call.params.text("program")?;
        self.logic
            .find(name)
            .map_err(|what| RpcError::new(code::INVALID_PARAMS, what))
    }

    pub(super) fn logic_look(&self, call: &Call<'_>) -> Result<LogicVariables, RpcError> {
        let task = self.logic_task(call)?;
        let names: Vec<String> = call.params.text("variable")?.map(str::to_owned).into_iter().collect();
        let invalid = |what| RpcError::new(code::INVALID_PARAMS, what);
        let from = match call.params.has("from") {
            true => call.params.number("from", 0, u64::from(u32::MAX))? as usize,
            false => 0,
        };
        let search = call.params.text("search")?.unwrap_or_default();
        let looked = self.logic.look_at(task, &names, search, from, VARIABLES_PER_PAGE);
        let (time_ns, shown, more) = looked.map_err(invalid)?;
        let variables = shown.into_iter().map(|shown| LogicVariable {
            name: shown.name,
            kind: shown.ty,
            value: shown.value,
            line: shown.line,
            role: match shown.role {
                ::logic::Role::Input => LogicRole::Input,
                ::logic::Role::Output => LogicRole::Output,
                ::logic::Role::Internal => LogicRole::Internal,
            },
            retain: shown.retain,
            pin: shown.pin,
            forced: shown.forced,
        });
        Ok(LogicVariables {
            program: self.logic.names()[task].to_owned(),
            time_ms: time_ns as f64 / 1e6,
            variables: variables.collect(),
            more,
        })
    }

    pub(super) fn logic_force(&mut self, call: &Call<'_>) -> Result<LogicForced, RpcError> {
        let task = self.logic_task(call)?;
        let variable = arguments::needed(call.params.text("variable")?, "variable", "a text")?;
        let value = arguments::needed(call.params.text("value")?, "value", "a text")?;
        let invalid = |what| RpcError::new(code::INVALID_PARAMS, what);
        let forced = self.logic.force(task, variable, value).map_err(invalid)?;
        self.note_logic(task, &format!("forced: {forced}"));
        Ok(LogicForced { forced })
    }

    pub(super) fn logic_release(&mut self, call: &Call<'_>) -> Result<LogicReleased, RpcError> {
        let task = self.logic_task(call)?;
        let variable = call.params.text("variable")?;
        let invalid = |what| RpcError::new(code::INVALID_PARAMS, what);
        let released = self.logic.release(task, variable).map_err(invalid)?;
        self.note_logic(
            task,
            &format!("released: {}", variable.unwrap_or("all that was forced")),
        );
        Ok(LogicReleased { released })
    }

    pub(super) fn logic_reload(&mut self, call: &Call<'_>) -> Result<Errand, RpcError> {
        let task = self.logic_task(call)?;
        let refused = |what| RpcError::new(code::REFUSED, what);
        let state = self.live.snapshot().state;
        if !state.may_replace_logic() {
            let what = format!(
                "the machine is {}: a program is only replaced while it rests",
                state.name()
            );
            return Err(refused(what));
        }
        let (desk, ticket) = (Arc::clone(&self.logic), call.ticket);
        // A program that was handed over is answered for by [`Methods::logic_replaced`].
        Ok(Box::new(move || {
            desk.replace(task, ticket).err().map(|what| Err(refused(what)))
        }))
    }

    /// What has come of a change: an answer to whoever has ordered it.
    pub(super) fn logic_replaced(&mut self, replaced: Replaced) -> (Ticket, Result<Value, RpcError>) {
        let result = match replaced.carried {
            Ok(carried) => {
                self.note_logic(replaced.task, "replaced by its changed file");
                value(&LogicReloaded { carried })
            }
            Err(what) => Err(RpcError::new(code::REFUSED, what)),
        };
        (replaced.ticket, result)
    }

    /// For the journal; nobody waits for its answer.
    pub(super) fn note_logic(&mut self, task: usize, what: &str) {
        let name = self.logic.names()[task].to_owned();
        let _ = self
            .operator
            .put(0, Order::Note(format!("warning: logic {name}: {what}").into()));
    }
}
