//! What is told of a machine: its components, and the items of data that each of them has.

use crate::xml::Element;

/// A machine, as it does not change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Machine {
    /// Its name; what a name cannot hold in MTConnect becomes `_`.
    pub name: String,
    /// Stays the same for ever, and is the only one in the world.
    pub uuid: String,
    /// What it is, in words.
    pub description: String,
    /// Its axes.
    pub axes: Vec<Axis>,
    /// It has a spindle.
    pub has_spindle: bool,
    /// The speed of the spindle is measured.
    pub measures_spindle: bool,
}

/// An axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Axis {
    /// X, Y, Z, A, B, C, U, V or W.
    pub letter: char,
    /// It counts degrees, not mm.
    pub is_rotary: bool,
    /// Where it is and its following error are measured.
    pub is_measured: bool,
    /// Its drive tells its load.
    pub has_load: bool,
}

/// A tool of the tool table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tool {
    /// T number.
    pub number: u32,
    /// Pocket of the magazine, 0: in the spindle.
    pub pocket: u32,
    /// mm.
    pub length_mm: f64,
    /// mm.
    pub diameter_mm: f64,
    /// What somebody has noted.
    pub remark: String,
}

/// What kind of data an item is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Category {
    Sample,
    Event,
    Condition,
}

impl Category {
    fn word(self) -> &'static str {
        match self {
            Category::Sample => "SAMPLE",
            Category::Event => "EVENT",
            Category::Condition => "CONDITION",
        }
    }
}

/// An item of data.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Item {
    pub(crate) id: String,
    pub(crate) category: Category,
    pub(crate) kind: &'static str,
    pub(crate) sub_kind: Option<&'static str>,
    /// What else its element of the model has.
    more: &'static [(&'static str, &'static str)],
    /// Number of its component.
    pub(crate) component: usize,
    /// Each observation counts, also one that says the same as the one before.
    pub(crate) is_discrete: bool,
    /// A set of keys and values.
    pub(crate) is_set: bool,
}

/// A component, which items belong to.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Component {
    pub(crate) id: String,
    pub(crate) kind: &'static str,
    pub(crate) name: Option<String>,
    /// Number of the one that it is part of.
    parent: Option<usize>,
}

/// Components and items.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Model {
    pub(crate) components: Vec<Component>,
    pub(crate) items: Vec<Item>,
    pub(crate) name: String,
    pub(crate) uuid: String,
    description: String,
}

const MM: (&str, &str) = ("units", "MILLIMETER");
const DEGREES: (&str, &str) = ("units", "DEGREE");
const PERCENT: (&str, &str) = ("units", "PERCENT");
const MM_S: (&str, &str) = ("units", "MILLIMETER/SECOND");
const RPM: (&str, &str) = ("units", "REVOLUTION/MINUTE");
const OF_MACHINE: (&str, &str) = ("coordinateSystem", "MACHINE");

impl Model {
    pub(crate) fn new(machine: &Machine) -> Model {
        let mut model = Model {
            components: Vec::new(),
            items: Vec::new(),
            name: name_of(&machine.name),
            uuid: machine.uuid.clone(),
            description: machine.description.clone(),
        };
        let device = model.component("dev", "Device", Some(model.name.clone()), None);
        model.event(device, "avail", "AVAILABILITY", None);
        model.event(device, "asset_changed", "ASSET_CHANGED", None).is_discrete = true;
        model.event(device, "asset_removed", "ASSET_REMOVED", None);
        let counts = model.event(device, "asset_count", "ASSET_COUNT", None);
        counts.more = &[("representation", "DATA_SET")];
        counts.is_set = true;
        let axes = model.component("axes", "Axes", None, Some(device));
        for axis in &machine.axes {
            model.axis(axes, *axis);
        }
        if machine.has_spindle {
            model.spindle(axes, machine.measures_spindle);
        }
        let controller = model.component("ctrl", "Controller", None, Some(device));
        model.event(controller, "estop", "EMERGENCY_STOP", None);
        for (id, sub_kind) in [
            ("single_block", "SINGLE_BLOCK"),
            ("optional_stop", "OPTIONAL_STOP"),
            ("dry_run", "DRY_RUN"),
        ] {
            model.event(controller, id, "CONTROLLER_MODE_OVERRIDE", Some(sub_kind));
        }
        model.event(controller, "message", "MESSAGE", None);
        for (id, kind) in [
            ("system", "SYSTEM"),
            ("logic", "LOGIC_PROGRAM"),
            ("motion", "MOTION_PROGRAM"),
            ("comms", "COMMUNICATIONS"),
        ] {
            model.item(controller, Category::Condition, id, kind, None, &[]);
        }
        model.path(controller);
        let systems = model.component("sys", "Systems", None, Some(device));
        let electric = model.component("elec", "Electric", None, Some(systems));
        model.event(electric, "power", "POWER_STATE", Some("LINE"));
        model
    }

    fn axis(&mut self, axes: usize, axis: Axis) {
        let name = axis.letter.to_ascii_uppercase().to_string();
        let id = |what: &str| format!("{}_{what}", axis.letter.to_ascii_lowercase());
        let kind = if axis.is_rotary { "Rotary" } else { "Linear" };
        let part = self.component(&id("axis"), kind, Some(name), Some(axes));
        let (place, error, of_place, of_error): (_, _, &[_], &[_]) = match axis.is_rotary {
            true => ("ANGLE", "FOLLOWING_ERROR_ANGULAR", &[DEGREES, OF_MACHINE], &[DEGREES]),
            false => ("POSITION", "FOLLOWING_ERROR_LINEAR", &[MM, OF_MACHINE], &[MM]),
        };
        self.sample(part, &id("com"), place, Some("COMMANDED"), of_place);
        if axis.is_measured {
            self.sample(part, &id("act"), place, Some("ACTUAL"), of_place);
            self.sample(part, &id("error"), error, Some("ACTUAL"), of_error);
        }
        if axis.has_load {
            self.sample(part, &id("load"), "LOAD", None, &[PERCENT]);
        }
        self.event(part, &id("state"), "AXIS_STATE", None);
        if axis.is_rotary {
            self.event(part, &id("mode"), "ROTARY_MODE", None);
        }
        self.item(part, Category::Condition, &id("travel"), "POSITION", None, &[]);
        self.item(part, Category::Condition, &id("drive"), "ACTUATOR", None, &[]);
    }

    fn spindle(&mut self, axes: usize, is_measured: bool) {
        let spindle = self.component("s_axis", "Rotary", Some("S".to_owned()), Some(axes));
        self.sample(spindle, "s_com", "ROTARY_VELOCITY", Some("COMMANDED"), &[RPM]);
        if is_measured {
            self.sample(spindle, "s_act", "ROTARY_VELOCITY", Some("ACTUAL"), &[RPM]);
        }
        self.event(spindle, "s_ovr", "ROTARY_VELOCITY_OVERRIDE", None).more = &[PERCENT];
        self.event(spindle, "s_mode", "ROTARY_MODE", None);
        self.event(spindle, "s_dir", "DIRECTION", Some("ROTARY"));
    }

    fn path(&mut self, controller: usize) {
        let path = self.component("path", "Path", None, Some(controller));
        for (id, kind, sub_kind) in [
            ("mode", "CONTROLLER_MODE", None),
            ("execution", "EXECUTION", None),
            ("wait", "WAIT_STATE", None),
            ("program", "PROGRAM", Some("ACTIVE")),
            ("line", "LINE_NUMBER", Some("ABSOLUTE")),
            ("tool_number", "TOOL_NUMBER", None),
            ("tool_asset", "TOOL_ASSET_ID", None),
            ("work_offset", "WORK_OFFSET", None),
            ("parts", "PART_COUNT", Some("ALL")),
            ("parts_wanted", "PART_COUNT", Some("TARGET")),
            ("active_axes", "ACTIVE_AXES", None),
        ] {
            self.event(path, id, kind, sub_kind);
        }
        for (id, sub_kind) in [("feed_ovr", "PROGRAMMED"), ("rapid_ovr", "RAPID")] {
            self.event(path, id, "PATH_FEEDRATE_OVERRIDE", Some(sub_kind)).more = &[PERCENT];
        }
        self.sample(path, "feed", "PATH_FEEDRATE", Some("COMMANDED"), &[MM_S]);
        let of_work = &[("units", "MILLIMETER_3D"), ("coordinateSystem", "WORK")];
        self.sample(path, "place", "PATH_POSITION", Some("COMMANDED"), of_work);
        let seconds = &[("units", "SECOND")];
        self.sample(path, "cut_time", "PROCESS_TIMER", Some("PROCESS"), seconds);
    }

    fn component(&mut self, id: &str, kind: &'static str, name: Option<String>, parent: Option<usize>) -> usize {
        let id = id.to_owned();
        self.components.push(Component { id, kind, name, parent });
        self.components.len() - 1
    }

    fn event(&mut self, component: usize, id: &str, kind: &'static str, sub_kind: Option<&'static str>) -> &mut Item {
        self.item(component, Category::Event, id, kind, sub_kind, &[])
    }

    fn sample(
        &mut self,
        component: usize,
        id: &str,
        kind: &'static str,
        sub_kind: Option<&'static str>,
        more: &'static [(&'static str, &'static str)],
    ) {
        self.item(component, Category::Sample, id, kind, sub_kind, more);
    }

    fn item(
        &mut self,
        component: usize,
        category: Category,
        id: &str,
        kind: &'static str,
        sub_kind: Option<&'static str>,
        more: &'static [(&'static str, &'static str)],
    ) -> &mut Item {
        let at = self.items.len();
        self.items.push(Item {
            id: id.to_owned(),
            category,
            kind,
            sub_kind,
            more,
            component,
            is_discrete: false,
            is_set: false,
        });
        &mut self.items[at]
    }

    /// Number of an item.
    pub(crate) fn find(&self, id: &str) -> Option<usize> {
        self.items.iter().position(|item| item.id == id)
    }

    /// The device as an element of a document, and of what a `path` looks through.
    pub(crate) fn device(&self) -> Element {
        self.element(0)
    }

    fn element(&self, number: usize) -> Element {
        let component = &self.components[number];
        let mut element = Element::new(component.kind).with("id", &component.id);
        if let Some(name) = &component.name {
            element = element.with("name", name);
        }
        if component.parent.is_none() {
            let description = Element::new("Description")
                .with("manufacturer", "isocnc")
                .saying(&self.description);
            element = element
                .with("uuid", &self.uuid)
                .with("mtconnectVersion", "2.7")
                .holding([description]);
        }
        let items: Vec<Element> = (self.items.iter())
            .filter(|item| item.component == number)
            .map(Item::element)
            .collect();
        if !items.is_empty() {
            element = element.holding([Element::new("DataItems").holding(items)]);
        }
        let parts: Vec<Element> = (0..self.components.len())
            .filter(|part| self.components[*part].parent == Some(number))
            .map(|part| self.element(part))
            .collect();
        match parts.is_empty() {
            true => element,
            false => element.holding([Element::new("Components").holding(parts)]),
        }
    }
}

impl Item {
    fn element(&self) -> Element {
        let mut element = Element::new("DataItem")
            .with("id", &self.id)
            .with("category", self.category.word())
            .with("type", self.kind);
        if let Some(sub_kind) = self.sub_kind {
            element = element.with("subType", sub_kind);
        }
        for (name, value) in self.more {
            element = element.with(name, *value);
        }
        if self.is_discrete {
            element = element.with("discrete", "true");
        }
        element
    }

    /// Name of the element of an observation: `PATH_FEEDRATE` becomes `PathFeedrate`.
    pub(crate) fn tag(&self) -> String {
        let words = self.kind.split('_').map(|word| {
            let (first, rest) = word.split_at(1);
            first.to_owned() + &rest.to_lowercase()
        });
        words.collect::<String>() + if self.is_set { "DataSet" } else { "" }
    }
}

/// A name of MTConnect.
fn name_of(name: &str) -> String {
    let plain: String = name
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || "-_.".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect();
    match plain.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        true => plain,
        false => format!("_{plain}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn each_id_is_there_once_and_the_axes_are_those_of_the_machine() {
        let axes = [('X', false), ('Z', false), ('C', true)].map(|(letter, is_rotary)| Axis {
            letter,
            is_rotary,
            is_measured: true,
            has_load: letter == 'X',
        });
        let machine = Machine {
            name: "1 mill!".into(),
            axes: axes.to_vec(),
            has_spindle: true,
            measures_spindle: true,
            ..Machine::default()
        };
        let model = Model::new(&machine);
        assert_eq!(model.name, "_1_mill_");
        let components = model.components.iter().map(|component| &component.id);
        let ids: Vec<&String> = model.items.iter().map(|item| &item.id).chain(components).collect();
        assert_eq!(ids.iter().collect::<HashSet<_>>().len(), ids.len(), "{ids:?}");
        let tag = |id: &str| model.items[model.find(id).unwrap()].tag();
        assert_eq!(
            ["x_com", "c_com", "s_ovr", "asset_count"].map(tag),
            ["Position", "Angle", "RotaryVelocityOverride", "AssetCountDataSet"]
        );
        assert_eq!(
            [model.find("z_load"), model.find("x_load")].map(|at| at.is_some()),
            [false, true]
        );
        assert_eq!(model.find("y_com"), None);
        assert_eq!(
            model
                .device()
                .children
                .iter()
                .map(|child| child.name.as_str())
                .collect::<Vec<_>>(),
            ["Description", "DataItems", "Components"]
        );
    }
}
