//! Lines of a client that come one after the other and run as one program, which grows while it runs: nothing stops between them.
//!
//! In:  lines, and whether they are to have been executed. Out: answers: there is room for more, or all of them are over.
//!
//! They are MDI in everything else: the modes that the line before has left, and whoever may type a line may send some. Nobody can check
//! them before they run; what is wrong at one of them is an alarm there, and the machine comes to rest behind the line before.

use api::rpc::RpcError;
use api::server::Ticket;
use program::growing::Growing;
use protocol::{Message, message};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;

/// Octets that may lie before the reader of the text when a client is told that there is room for more: some hundred lines.
const AHEAD: u64 = 8192;

/// A text that grows, and who waits for what of it.
pub(super) struct Streamed {
    text: Arc<Growing>,
    puts: VecDeque<Put>,
    /// Where the text ends.
    end: u64,
}

struct Put {
    ticket: Ticket,
    end: u64,
    /// It is to be told when all has been executed.
    waits: bool,
}

type Answers = Vec<(Ticket, Result<Value, RpcError>)>;

impl Streamed {
    /// A text that nobody has read yet.
    ///
    /// # Errors
    /// There is no temporary file to be had.
    pub(super) fn new() -> io::Result<Streamed> {
        Ok(Streamed {
            text: Arc::new(Growing::new()?),
            puts: VecDeque::new(),
            end: 0,
        })
    }

    pub(super) fn text(&self) -> &Arc<Growing> {
        &self.text
    }

    /// Takes lines. False: it has ended, and they belong to another one.
    ///
    /// # Errors
    /// The disk does not take them.
    pub(super) fn take(&mut self, ticket: Ticket, lines: &str, waits: bool) -> io::Result<bool> {
        if !lines.is_empty() {
            let Some(end) = self.text.append(lines)? else {
                return Ok(false);
            };
            self.end = end;
            // Whoever waits for the end of lines sends nothing before it: the reader need not wait for more.
            if waits {
                self.text.close();
            }
        }
        let end = self.end;
        self.puts.push_back(Put { ticket, end, waits });
        Ok(true)
    }

    /// Who can be answered by now.
    pub(super) fn answers(&mut self) -> Answers {
        let read = self.text.read_to();
        let mut answers = Vec::new();
        self.puts.retain(|put| {
            let is_waited_for = put.waits || put.end > read + AHEAD;
            if !is_waited_for {
                answers.push((put.ticket, Ok(json!({}))));
            }
            is_waited_for
        });
        answers
    }

    /// All of it is over: it has come to its end, or was given up for this reason. What nobody has read then has not run.
    pub(super) fn end(self, given_up: Option<&Message>) -> Answers {
        self.text.close();
        let read = self.text.read_to();
        let answer = |put: Put| {
            let answer = match given_up {
                Some(why) => Err(why.clone().into()),
                None if put.end > read => Err(message!(
                    "refused.lines_after_end",
                    "the program ended (M2, M30) before these lines"
                )
                .into()),
                None => Ok(json!({})),
            };
            (put.ticket, answer)
        };
        self.puts.into_iter().map(answer).collect()
    }

    /// Somebody does not wait any more: nothing more comes.
    pub(super) fn withdraw(&mut self, ticket: Ticket) {
        let before = self.puts.len();
        self.puts.retain(|put| put.ticket != ticket);
        if self.puts.len() < before {
            self.text.close();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tickets(answers: Answers) -> Vec<(Ticket, bool)> {
        answers
            .into_iter()
            .map(|(ticket, answer)| (ticket, answer.is_ok()))
            .collect()
    }

    #[test]
    fn room_is_told_when_the_reader_is_near_and_an_end_when_all_is_over() {
        let mut streamed = Streamed::new().unwrap();
        let many = "G1 X1 F100\n".repeat(2000);
        assert!(streamed.take(1, "G0 X1\n", false).unwrap());
        assert!(streamed.take(2, &many, false).unwrap());
        assert!(streamed.take(3, "", true).unwrap());
        assert_eq!(tickets(streamed.answers()), [(1, true)]);
        let mut buffer = vec![0; "G0 X1\n".len() + many.len()];
        streamed.text().read_at(&mut buffer, 0).unwrap();
        assert_eq!(tickets(streamed.answers()), [(2, true)]);
        assert_eq!(tickets(streamed.answers()), []);
        assert_eq!(tickets(streamed.end(None)), [(3, true)]);
    }

    #[test]
    fn lines_that_nobody_has_read_have_not_run() {
        let mut streamed = Streamed::new().unwrap();
        streamed.take(1, "M2\n", false).unwrap();
        streamed.text().read_at(&mut [0; 9], 0).unwrap();
        streamed.take(2, "G0 X1\n", true).unwrap();
        assert!(
            !streamed.take(3, "G0 X2\n", true).unwrap(),
            "behind lines that are waited for"
        );
        assert_eq!(tickets(streamed.end(None)), [(1, true), (2, false)]);
        let mut streamed = Streamed::new().unwrap();
        streamed.take(1, "G0 X1\n", false).unwrap();
        streamed.take(2, "G0 X2\n", true).unwrap();
        streamed.withdraw(1);
        assert!(
            !streamed.take(3, "G0 X3\n", true).unwrap(),
            "whoever goes sends nothing more"
        );
        assert_eq!(tickets(streamed.end(Some(&"stopped".into()))), [(2, false)]);
    }
}
