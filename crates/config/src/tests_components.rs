//! `[[hal.component]]`: what is read, and what is refused where.

use super::tests::behind_demo;
use super::*;
use hal_pins::AnyValue;

fn read(components: &str) -> Result<Vec<Component>, Vec<String>> {
    behind_demo(components, |config| config.components)
}

#[test]
fn components_are_read_with_their_options_and_values() {
    let read = read(
        "[[hal.component]]\nname = \"logic.0\"\ntype = \"logic\"\noptions = { personality = 3 }\nset = { in-02 = true }\n\
         [[hal.component]]\nname = \"changer\"\ntype = \"carousel\"\nplace = \"after-motion\"\n\
         options = { encoding = \"bcd\", pockets = 20 }\nset = { rev-pulse = 1, fwd-dc = 0.5, pocket-number = -1 }\n",
    )
    .unwrap();
    assert_eq!(read[0].options, [("personality".to_owned(), 3)]);
    assert_eq!(read[0].set, [("in-02".to_owned(), AnyValue::Bit(true))]);
    assert_eq!(
        (read[0].place, read[1].place),
        (Place::BeforeMotion, Place::AfterMotion)
    );
    assert_eq!(read[1].kind, "carousel");
    assert_eq!(
        read[1].options,
        [("encoding".to_owned(), 2), ("pockets".to_owned(), 20)]
    );
    let floats = [
        ("rev-pulse", AnyValue::Float(1.0)),
        ("fwd-dc", AnyValue::Float(0.5)),
        ("pocket-number", AnyValue::S32(-1)),
    ];
    assert_eq!(read[1].set, floats.map(|(pin, value)| (pin.to_owned(), value)));
}

#[test]
fn every_mistake_is_told_at_its_place() {
    let refused = read(
        "[[hal.component]]\nname = \"a\"\ntype = \"and3\"\n\
         [[hal.component]]\nname = \"A_B\"\ntype = \"and2\"\nplace = \"later\"\n\
         [[hal.component]]\nname = \"s\"\ntype = \"scale\"\nset = { gian = 1, gain = true, out = 1, offset = nan, in = 2 }\n\
         [[hal.component]]\nname = \"s\"\ntype = \"logic\"\noptions = { personality = 17, size = 3 }\n\
         [[hal.component]]\nname = \"c\"\ntype = \"carousel\"\noptions = { encoding = \"grey\", pockets = 1.5 }\n\
         [[hal.component]]\n\
         [[hal.net]]\nname = \"to-s\"\nsource = \"a.out\"\ntargets = [\"s.in\"]\n",
    )
    .unwrap_err();
    let expected = [
        "3:8: hal.component[0].type = \"and3\": is no component: docs/components.md has them all; did you mean \"and2\"?",
        "5:8: hal.component[1].name = \"A_B\": must be a name of lower-case letters, digits, dashes and dots, like \"joint.0.f-error\"",
        "7:9: hal.component[1].place = \"later\": must be \"before-motion\" or \"after-motion\"",
        "11:16: hal.component[2].set.gian = 1: is no pin of this component; did you mean \"gain\"?",
        "11:26: hal.component[2].set.gain = true: must be a number",
        "11:38: hal.component[2].set.out = 1: is an output, which the component writes",
        "11:50: hal.component[2].set.offset = nan: must be true, false, a finite number or a word, is a float",
        "11:60: hal.component[2].set.in = 2: is written by net \"to-s\": a pin has one writer",
        "13:8: hal.component[3].name = \"s\": is taken by a component above",
        "15:27: hal.component[3].options.personality = 17: must be 1 to 16",
        "15:38: hal.component[3].options.size = 3: is no option of logic: it has personality",
        "19:24: hal.component[4].options.encoding = \"grey\": must be \"gray\" or \"binary\" or \"bcd\" or \"single\" or \"index\"",
        "19:42: hal.component[4].options.pockets = 1.5: must be an integer",
        "20:1: hal.component[5].name: is missing: the name of the instance",
        "20:1: hal.component[5].type: is missing: what kind of component it is",
    ];
    assert_eq!(refused, expected);
}
