//! The agent: what is known of a machine, and the answer to each request.

use crate::document::{self, Document, Errors, Head, Refusal};
use crate::facts::{self, Facts, tool_id};
use crate::model::{Machine, Model, Tool};
use crate::request::{self, Kind, Request};
use crate::ring::{Observation, Ring, Value};
use crate::stream::{Every, Stream};
use crate::xpath;
use std::time::Duration;

/// Tools that are told of at the most.
const TOOLS_MAX: usize = 1024;

/// What an agent is called, and how much it keeps.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Who sends the documents: a name of this PC.
    pub sender: String,
    /// Another one for each agent that begins to count: clients ask for everything anew then.
    pub instance: u64,
    /// Observations that are kept.
    pub buffer: usize,
    /// How errors are told.
    pub errors: Errors,
}

/// An answer to a request.
#[derive(Debug)]
pub enum Reply {
    /// One document.
    Document(Document),
    /// Parts that go on.
    Stream(Stream),
}

/// What is known of a machine.
#[derive(Debug)]
pub struct Agent {
    settings: Settings,
    model: Model,
    /// Letters of the axes, and whether they count degrees.
    letters: Vec<(char, bool)>,
    ring: Ring,
    tools: Vec<Tool>,
    tools_since: Duration,
    since: Duration,
}

/// Which items are meant; `None`: all.
pub(crate) type Filter = Option<Vec<usize>>;

impl Agent {
    /// Of a machine of which nothing else is known yet. `now`: since 1970, here and everywhere.
    pub fn new(machine: &Machine, settings: Settings, now: Duration) -> Agent {
        let model = Model::new(machine);
        Agent {
            ring: Ring::new(settings.buffer, model.items.len(), now),
            settings,
            letters: machine.axes.iter().map(|axis| (axis.letter, axis.is_rotary)).collect(),
            model,
            tools: Vec::new(),
            tools_since: now,
            since: now,
        }
    }

    /// Takes how the machine is.
    pub fn observe(&mut self, facts: &Facts, now: Duration) {
        facts::observe(&mut self.ring, &self.model, &self.letters, facts, now);
    }

    /// Nobody knows how the machine is any more.
    pub fn lose(&mut self, now: Duration) {
        for item in 0..self.model.items.len() {
            let is_of_agent = self.model.items[item].id.starts_with("asset_");
            if !is_of_agent {
                self.ring.see(item, Value::Unavailable, now);
            }
        }
    }

    /// Takes the tool table.
    pub fn tools(&mut self, mut tools: Vec<Tool>, now: Duration) {
        tools.truncate(TOOLS_MAX);
        tools.sort_by_key(|tool| tool.number);
        tools.dedup_by_key(|tool| tool.number);
        if self.tools == tools {
            return;
        }
        let before = std::mem::replace(&mut self.tools, tools);
        self.tools_since = now;
        let mut tell = |id: &str, value: Value| {
            if let Some(item) = self.model.find(id) {
                self.ring.put(item, value, now);
            }
        };
        for tool in self.tools.iter().filter(|tool| !before.contains(tool)) {
            tell("asset_changed", Value::Text(tool_id(tool.number)));
        }
        let is_there = |tool: &&Tool| self.tools.iter().all(|known| known.number != tool.number);
        for tool in before.iter().filter(is_there) {
            tell("asset_removed", Value::Text(tool_id(tool.number)));
        }
        let count = self.tools.len().to_string();
        tell("asset_count", Value::Set(vec![("CuttingTool".into(), count)]));
    }

    /// Numbers of the first observation that is kept, and of the one that comes next.
    pub fn range(&self) -> (u64, u64) {
        self.ring.range()
    }

    /// Answers a request; `path` begins behind what stands before the requests of MTConnect.
    pub fn answer(&self, path: &str, query: &str, now: Duration) -> Reply {
        match request::read(path, query).and_then(|request| self.serve(&request, now)) {
            Ok(reply) => reply,
            Err((refusal, message)) => {
                let uri = if query.is_empty() {
                    path.to_owned()
                } else {
                    format!("{path}?{query}")
                };
                Reply::Document(document::error(&self.head(now), &uri, &refusal, &message))
            }
        }
    }

    fn serve(&self, request: &Request, now: Duration) -> Result<Reply, (Refusal, String)> {
        let names = [&self.model.name, &self.model.uuid];
        if let Some(device) = &request.device
            && !names.contains(&device)
        {
            return Err((
                Refusal::NoDevice,
                format!("there is no device {device}; there is {}", self.model.name),
            ));
        }
        let filter = match &request.path {
            None => None,
            Some(path) => Some(self.filter(path)?),
        };
        let document = match &request.kind {
            Kind::Probe => document::devices(&self.head(now), &self.model),
            Kind::Current { at } => {
                if let Some(ms) = request.interval {
                    let every = Every::of(ms, request.heartbeat);
                    return Ok(Reply::Stream(Stream::current(filter, every)));
                }
                self.current(*at, &filter, now)?
            }
            Kind::Sample { from, to, count } => {
                let from = self.from(*from)?;
                if let Some(ms) = request.interval {
                    let every = Every::of(ms, request.heartbeat);
                    return Ok(Reply::Stream(Stream::sample(filter, every, from, *count)));
                }
                let (first, next) = self.ring.range();
                if let Some(to) = to.filter(|to| !(from..next).contains(to)) {
                    let message = format!("to is a number from {from} to {}, got {to}; {first} is kept", next - 1);
                    return Err((out_of_range("to", to, [from, next - 1]), message));
                }
                self.sample(from, *to, *count, &filter, now).0
            }
            Kind::Assets { kind, count } => {
                let tools = self.tools.iter().take(*count);
                let is_tool = kind.as_deref().is_none_or(|kind| kind == "CuttingTool");
                let tools = tools.filter(|_| is_tool);
                document::assets(&self.head(now), &self.model.uuid, self.tools_since, tools)
            }
            Kind::Asset(ids) => {
                let found = ids.iter().map(|id| {
                    let tool = self.tools.iter().find(|tool| tool_id(tool.number) == *id);
                    tool.ok_or_else(|| (Refusal::AssetNotFound(id.clone()), format!("there is no asset {id}")))
                });
                let found: Vec<&Tool> = found.collect::<Result<_, _>>()?;
                document::assets(&self.head(now), &self.model.uuid, self.tools_since, found.into_iter())
            }
        };
        Ok(Reply::Document(document))
    }

    fn filter(&self, path: &str) -> Result<Vec<usize>, (Refusal, String)> {
        let ids = xpath::items(path, &self.model.device()).map_err(|why| (Refusal::InvalidPath, why))?;
        Ok(ids.iter().filter_map(|id| self.model.find(id)).collect())
    }

    fn from(&self, from: Option<u64>) -> Result<u64, (Refusal, String)> {
        let (first, next) = self.ring.range();
        match from {
            None | Some(0) => Ok(first),
            Some(from) if (first..=next).contains(&from) => Ok(from),
            Some(from) => {
                let message = format!("from is a number from {first} to {next}, got {from}");
                Err((out_of_range("from", from, [first, next]), message))
            }
        }
    }

    fn current(&self, at: Option<u64>, filter: &Filter, now: Duration) -> Result<Document, (Refusal, String)> {
        let (first, next) = self.ring.range();
        let Some(at) = at else {
            return Ok(self.now(filter, now));
        };
        if !(first..next).contains(&at) {
            let message = format!("at is a number from {first} to {}, got {at}", next - 1);
            return Err((out_of_range("at", at, [first, next - 1]), message));
        }
        let latest = self.ring.at(at);
        let range = (first, next, next);
        Ok(document::streams(
            &self.head(now),
            &self.model,
            range,
            latest.all().filter(|seen| is_meant(filter, seen)),
        ))
    }

    /// How everything is.
    pub(crate) fn now(&self, filter: &Filter, now: Duration) -> Document {
        let (first, next) = self.ring.range();
        let latest = self.ring.latest().all().filter(|seen| is_meant(filter, seen));
        document::streams(&self.head(now), &self.model, (first, next, next), latest)
    }

    /// So many observations from a number on, which one to ask for next, and how many there are.
    pub(crate) fn sample(
        &self,
        from: u64,
        to: Option<u64>,
        count: u64,
        filter: &Filter,
        now: Duration,
    ) -> (Document, u64, usize) {
        let (first, next) = self.ring.range();
        let meant = self
            .ring
            .from(from)
            .take_while(|seen| to.is_none_or(|to| seen.sequence <= to));
        let told: Vec<&Observation> = meant
            .filter(|seen| is_meant(filter, seen))
            .take(count as usize)
            .collect();
        let to_ask = match told.last() {
            Some(last) if told.len() as u64 == count => last.sequence + 1,
            _ => to.map_or(next, |to| to + 1),
        };
        let count = told.len();
        let document = document::streams(&self.head(now), &self.model, (first, next, to_ask), told.into_iter());
        (document, to_ask, count)
    }

    fn head(&self, now: Duration) -> Head {
        Head {
            now,
            instance: self.settings.instance,
            sender: self.settings.sender.clone(),
            since: self.since,
            buffer: self.ring.size(),
            errors: self.settings.errors,
            assets: self.tools.len(),
            asset_room: TOOLS_MAX,
        }
    }

    /// Ids and values of all items, for an adapter.
    pub(crate) fn shown(&self, from: u64) -> impl Iterator<Item = (&crate::model::Item, &Observation)> {
        self.ring.from(from).map(|seen| (&self.model.items[seen.item], seen))
    }

    pub(crate) fn latest(&self) -> impl Iterator<Item = (&crate::model::Item, &Observation)> {
        self.ring
            .latest()
            .all()
            .map(|seen| (&self.model.items[seen.item], seen))
    }

    pub(crate) fn device_uuid(&self) -> &str {
        &self.model.uuid
    }

    pub(crate) fn device_name(&self) -> &str {
        &self.model.name
    }

    /// A number that a stream has not been told yet has gone: the error that it ends with.
    pub(crate) fn lost(&self, from: u64, now: Duration) -> Option<Document> {
        let (refusal, message) = self.from(Some(from)).err()?;
        Some(document::error(&self.head(now), "/sample", &refusal, &message))
    }
}

fn is_meant(filter: &Filter, seen: &Observation) -> bool {
    filter.as_ref().is_none_or(|items| items.contains(&seen.item))
}

fn out_of_range(name: &str, value: u64, limits: [u64; 2]) -> Refusal {
    let name = name.to_owned();
    Refusal::OutOfRange { name, value, limits }
}
