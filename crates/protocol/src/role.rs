//! What a client of the control, and the supervisor of a cell, may do at the machine.

use crate::message;
use crate::rpc::{RpcError, code};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// What a client may do. Each role includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Look, and bring the machine to rest: hold, stop, emergency stop, slower overrides.
    Watch,
    /// Work with the machine: jog, MDI, programs, offsets, tools.
    Operate,
    /// Change what it is: objects of nodes, pins, the machine file.
    SetUp,
}

/// What the supervisor of a cell may do at a machine, each more than the one before; holding and stopping is always allowed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Remote {
    /// Look.
    #[default]
    Off,
    /// Send programs.
    Upload,
    /// Run them.
    Run,
}

impl Role {
    /// All of them.
    pub const ALL: [Role; 3] = [Role::Watch, Role::Operate, Role::SetUp];

    /// As it is written.
    pub const fn name(self) -> &'static str {
        match self {
            Role::Watch => "watch",
            Role::Operate => "operate",
            Role::SetUp => "set-up",
        }
    }

    /// Lets a client of this role do what asks for another one.
    ///
    /// # Errors
    /// It may not.
    pub fn permit(self, needed: Role) -> Result<(), RpcError> {
        if self >= needed {
            return Ok(());
        }
        let what = message!(
            "refused.role",
            "this asks for the role \"{needed}\", and this client has \"{role}\": log in with a token of that role",
            needed = needed.name(),
            role = self.name()
        );
        let data = json!({ "role": self.name(), "needed": needed.name() });
        Err(RpcError::new(code::NOT_ALLOWED, what).with_data(data))
    }
}

impl std::str::FromStr for Role {
    type Err = String;

    fn from_str(text: &str) -> Result<Role, String> {
        let found = Role::ALL.into_iter().find(|role| role.name() == text);
        found.ok_or_else(|| "expected watch, operate or set-up".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_role_has_those_before_it() {
        for (at, role) in Role::ALL.into_iter().enumerate() {
            for (place, needed) in Role::ALL.into_iter().enumerate() {
                let refused = role.permit(needed).err();
                assert_eq!(refused.is_some(), place > at);
                assert!(
                    refused.is_none_or(
                        |error| error.code == code::NOT_ALLOWED && error.message.text.contains(needed.name())
                    )
                );
            }
            assert_eq!(json!(role), json!(role.name()));
            assert_eq!(role.name().parse(), Ok(role));
        }
    }
}
