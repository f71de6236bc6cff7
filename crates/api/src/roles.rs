//! What somebody may do at the machine, each more than the one before.

use super::rpc::{RpcError, code};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// What somebody may do. Whoever has a role has those before it, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Look, and bring the machine to rest: hold, stop, emergency stop, slower overrides.
    Watch,
    /// Work with the machine: jog, MDI, programs, offsets, tools.
    Operate,
    /// Change what it is: objects of nodes, pins, the machine file.
    SetUp,
}

impl Role {
    pub const ALL: [Role; 3] = [Role::Watch, Role::Operate, Role::SetUp];

    /// As it is written.
    pub const fn name(self) -> &'static str {
        match self {
            Role::Watch => "watch",
            Role::Operate => "operate",
            Role::SetUp => "set-up",
        }
    }

    /// Lets somebody of this role do what asks for another one.
    ///
    /// # Errors
    /// He may not.
    pub fn permit(self, needed: Role) -> Result<(), RpcError> {
        if self >= needed {
            return Ok(());
        }
        let what = format!(
            "this asks for the role \"{}\", and this client has \"{}\": log in with a token of that role",
            needed.name(),
            self.name()
        );
        let data = json!({ "role": self.name(), "needed": needed.name() });
        Err(RpcError::new(code::NOT_ALLOWED, what).with_data(data))
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
                    refused
                        .is_none_or(|error| error.code == code::NOT_ALLOWED && error.message.contains(needed.name()))
                );
            }
            assert_eq!(json!(role), json!(role.name()));
        }
    }
}
