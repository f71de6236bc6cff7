//! The four kinds of documents, and their heads.

use crate::facts::tool_id;
use crate::model::{Category, Model, Tool};
use crate::ring::{Condition, Observation, Value};
use crate::time::stamp;
use crate::xml::{Element, is_name};
use std::time::Duration;

/// Version of the standard.
const VERSION: &str = "2.7";

/// An answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Document {
    /// Of HTTP.
    pub status: u16,
    /// `text/xml`.
    pub xml: String,
}

/// How errors are told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Errors {
    /// With the elements that MTConnect has for each kind of them since 2.6.
    #[default]
    Typed,
    /// As `Error` with its code, in a document of 2.2, which clients from before 2.6 read.
    Coded,
}

/// Version of the standard that such documents are of.
const CODED_VERSION: &str = "2.2";

/// What heads of documents tell.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) now: Duration,
    pub(crate) instance: u64,
    pub(crate) sender: String,
    pub(crate) since: Duration,
    pub(crate) buffer: usize,
    pub(crate) errors: Errors,
    pub(crate) assets: usize,
    pub(crate) asset_room: usize,
}

impl Head {
    fn element(&self) -> Element {
        self.of_version(VERSION)
            .with("deviceModelChangeTime", stamp(self.since))
    }

    fn of_version(&self, version: &str) -> Element {
        Element::new("Header")
            .with("creationTime", stamp(self.now))
            .with("sender", &self.sender)
            .with("instanceId", self.instance.to_string())
            .with("version", version)
    }

    fn with_buffer(&self) -> Element {
        self.element().with("bufferSize", self.buffer.to_string())
    }

    fn with_assets(&self, head: Element) -> Element {
        head.with("assetBufferSize", self.asset_room.to_string())
            .with("assetCount", self.assets.to_string())
    }
}

fn document(kind: &str, status: u16, head: Element, body: Element) -> Document {
    document_of(VERSION, kind, status, head, body)
}

fn document_of(version: &str, kind: &str, status: u16, head: Element, body: Element) -> Document {
    let root = format!("MTConnect{kind}");
    let space = format!("urn:mtconnect.org:{root}:{version}");
    let xml = Element::new(&root)
        .with("xmlns", space)
        .holding([head, body])
        .document();
    Document { status, xml }
}

/// `probe`
pub(crate) fn devices(head: &Head, model: &Model) -> Document {
    let top = head.with_assets(head.with_buffer());
    document("Devices", 200, top, Element::new("Devices").holding([model.device()]))
}

/// `current` and `sample`; `range`: the first number that is kept and the next one, and which one the client is to ask for next.
pub(crate) fn streams<'o>(
    head: &Head,
    model: &Model,
    (first, next, to_ask): (u64, u64, u64),
    observations: impl Iterator<Item = &'o Observation>,
) -> Document {
    let top = head
        .with_buffer()
        .with("firstSequence", first.to_string())
        .with("lastSequence", (next - 1).to_string())
        .with("nextSequence", to_ask.to_string());
    let mut parts: Vec<[Vec<Element>; 3]> = vec![Default::default(); model.components.len()];
    for observation in observations {
        let item = &model.items[observation.item];
        parts[item.component][item.category as usize].push(element(model, observation));
    }
    let components = model
        .components
        .iter()
        .zip(parts)
        .filter(|(_, parts)| parts.iter().any(|part| !part.is_empty()));
    let streams = components.map(|(component, parts)| {
        let mut stream = Element::new("ComponentStream").with("component", component.kind);
        if let Some(name) = &component.name {
            stream = stream.with("name", name);
        }
        let names = ["Samples", "Events", "Condition"]
            .into_iter()
            .zip(parts)
            .filter(|(_, part)| !part.is_empty());
        stream
            .with("componentId", &component.id)
            .holding(names.map(|(name, part)| Element::new(name).holding(part)))
    });
    let device = Element::new("DeviceStream")
        .with("name", &model.name)
        .with("uuid", &model.uuid);
    let device = device.holding(streams.collect::<Vec<_>>());
    document("Streams", 200, top, Element::new("Streams").holding([device]))
}

fn element(model: &Model, observation: &Observation) -> Element {
    let item = &model.items[observation.item];
    let name = match (&observation.value, item.category) {
        (Value::Condition(Condition::Normal(_)), _) => "Normal".to_owned(),
        (Value::Condition(Condition::Warning { .. }), _) => "Warning".into(),
        (Value::Condition(Condition::Fault { .. }), _) => "Fault".into(),
        (Value::Unavailable, Category::Condition) => "Unavailable".into(),
        _ => item.tag(),
    };
    let mut element = Element::new(name)
        .with("dataItemId", &item.id)
        .with("sequence", observation.sequence.to_string())
        .with("timestamp", stamp(observation.time));
    if item.category == Category::Condition {
        element = element.with("type", item.kind);
    }
    if let Some(sub_kind) = item.sub_kind {
        element = element.with("subType", sub_kind);
    }
    match &observation.value {
        Value::Unavailable if item.category == Category::Condition => element,
        Value::Unavailable if item.is_set => element.with("count", "0").saying("UNAVAILABLE"),
        Value::Unavailable => element.saying("UNAVAILABLE"),
        Value::Text(text) => match item.kind {
            "ASSET_CHANGED" | "ASSET_REMOVED" => element.with("assetType", "CuttingTool").saying(text),
            _ => element.saying(text),
        },
        Value::Set(entries) => {
            let element = element.with("count", entries.len().to_string());
            let entries = entries
                .iter()
                .map(|(key, value)| Element::new("Entry").with("key", key).saying(value));
            element.holding(entries.collect::<Vec<_>>())
        }
        Value::Condition(Condition::Normal(None)) => element,
        Value::Condition(Condition::Normal(Some(code))) => element.with("nativeCode", code).with("conditionId", code),
        Value::Condition(Condition::Warning { code, text } | Condition::Fault { code, text }) => {
            element.with("nativeCode", code).with("conditionId", code).saying(text)
        }
    }
}

/// `assets`
pub(crate) fn assets<'t>(head: &Head, uuid: &str, since: Duration, tools: impl Iterator<Item = &'t Tool>) -> Document {
    let tools = tools.map(|tool| asset(tool, uuid, since));
    let body = Element::new("Assets").holding(tools.collect::<Vec<_>>());
    document("Assets", 200, head.with_assets(head.element()), body)
}

fn asset(tool: &Tool, uuid: &str, since: Duration) -> Element {
    let measure = |name: &str, code: &str, value_mm: f64| {
        Element::new(name)
            .with("code", code)
            .with("units", "MILLIMETER")
            .with("nominal", format!("{value_mm}"))
            .saying(format!("{value_mm}"))
    };
    let location = match tool.pocket {
        0 => Element::new("Location").with("type", "SPINDLE").saying("0"),
        pocket => Element::new("Location").with("type", "POT").saying(pocket.to_string()),
    };
    let status = Element::new("CutterStatus").holding([Element::new("Status").saying("AVAILABLE")]);
    let measures = [
        measure("FunctionalLength", "LF", tool.length_mm),
        measure("CuttingDiameterMax", "DC", tool.diameter_mm),
    ];
    let life = Element::new("CuttingToolLifeCycle").holding([
        status,
        Element::new("ProgramToolNumber").saying(tool.number.to_string()),
        location,
        Element::new("Measurements").holding(measures),
    ]);
    let mut asset = Element::new("CuttingTool")
        .with("assetId", tool_id(tool.number))
        .with("toolId", tool.number.to_string())
        .with("timestamp", stamp(since))
        .with("deviceUuid", uuid)
        .holding([life]);
    if !tool.remark.is_empty() {
        asset = asset.holding([Element::new("Description").saying(&tool.remark)]);
    }
    asset
}

/// What is wrong with a request.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Refusal {
    NoDevice,
    InvalidUri,
    InvalidPath,
    Unsupported,
    AssetNotFound(String),
    /// A parameter, its value, and its limits where it is a number.
    Value {
        name: String,
        value: String,
        limits: Option<[u64; 2]>,
    },
    OutOfRange {
        name: String,
        value: u64,
        limits: [u64; 2],
    },
}

/// An error; `uri`: what was asked for.
pub(crate) fn error(head: &Head, uri: &str, refusal: &Refusal, message: &str) -> Document {
    match head.errors {
        Errors::Typed => typed_error(head, uri, refusal, message),
        Errors::Coded => coded_error(head, refusal, message),
    }
}

fn coded_error(head: &Head, refusal: &Refusal, message: &str) -> Document {
    let (status, code) = match refusal {
        Refusal::NoDevice => (404, "NO_DEVICE"),
        Refusal::InvalidUri => (404, "INVALID_URI"),
        Refusal::InvalidPath => (400, "INVALID_PATH"),
        Refusal::Unsupported => (400, "UNSUPPORTED"),
        Refusal::AssetNotFound(_) => (404, "ASSET_NOT_FOUND"),
        Refusal::Value { .. } => (400, "INVALID_REQUEST"),
        Refusal::OutOfRange { .. } => (404, "OUT_OF_RANGE"),
    };
    let error = Element::new("Error").with("errorCode", code).saying(message);
    let head = head
        .of_version(CODED_VERSION)
        .with("bufferSize", head.buffer.to_string());
    let body = Element::new("Errors").holding([error]);
    document_of(CODED_VERSION, "Error", status, head, body)
}

fn typed_error(head: &Head, uri: &str, refusal: &Refusal, message: &str) -> Document {
    let parameter = |name: &str, value: String, limits: Option<[u64; 2]>| {
        let limits = limits.into_iter().flat_map(|[low, high]| {
            let one = |name, value: u64| Element::new(name).saying(value.to_string());
            [one("Minimum", low), one("Maximum", high)]
        });
        let parameter = Element::new("QueryParameter").with("name", name);
        parameter.holding(limits.chain([Element::new("Value").saying(value)]).collect::<Vec<_>>())
    };
    let old = |code: &str| Element::new("ErrorDeprecated").with("errorCode", code).saying(message);
    let new = |name: &str| {
        let told = [
            Element::new("URI").saying(uri),
            Element::new("ErrorMessage").saying(message),
        ];
        Element::new(name).holding(told)
    };
    // Names of parameters that the schema does not know cannot stand in its new elements.
    let is_known = |name: &str| ["path", "from", "count", "interval", "heartbeat"].contains(&name);
    let (status, element) = match refusal {
        Refusal::NoDevice => (404, new("NoDevice")),
        Refusal::InvalidUri => (404, new("InvalidURI")),
        Refusal::InvalidPath => (400, new("InvalidXPath")),
        Refusal::Unsupported => (400, new("Unsupported")),
        Refusal::AssetNotFound(id) if is_name(id) => {
            (404, new("AssetNotFound").holding([Element::new("AssetId").saying(id)]))
        }
        Refusal::AssetNotFound(_) => (404, old("ASSET_NOT_FOUND")),
        Refusal::Value { name, value, limits } if is_known(name) => (
            400,
            new("InvalidParameterValue").holding([parameter(name, value.clone(), *limits)]),
        ),
        Refusal::Value { .. } => (400, old("INVALID_REQUEST")),
        Refusal::OutOfRange { name, value, limits } if is_known(name) => (
            404,
            new("OutOfRange").holding([parameter(name, value.to_string(), Some(*limits))]),
        ),
        Refusal::OutOfRange { .. } => (404, old("OUT_OF_RANGE")),
    };
    document(
        "Error",
        status,
        head.with_buffer(),
        Element::new("Errors").holding([element]),
    )
}
