//! What other controls write: their codes, and texts in languages that are not this one.
//!
//! In:  the number of a code that there is not; a line that is wrong.
//! Out: whose it is and what to write here.

use crate::error::ErrorKind;
use crate::octet::is_blank;
use std::fmt;

/// G codes of other controls in ascending order of ten times their number: what each is there, and what to write here.
const G_CODES: &[(u32, &str)] = &[
    (
        71,
        "cylindrical interpolation of Fanuc and Haas: it has no like here, post the moves for the rotary axis",
    ),
    (
        90,
        "the exact stop of one line: write G61.1 before that line and G64 behind it",
    ),
    (110, "the end of G10 data on Fanuc: leave it out"),
    (
        120,
        "a circular pocket of other controls: it has no like here, post its arcs",
    ),
    (
        121,
        "polar interpolation of Fanuc: it has no like here, post the moves for the rotary axis",
    ),
    (
        130,
        "a circular pocket of other controls: it has no like here, post its arcs",
    ),
    (131, "the end of polar interpolation of Fanuc, which has no like here"),
    (
        150,
        "the end of polar coordinates on Fanuc and Haas: leave it out, X and Y need no code",
    ),
    (
        160,
        "polar coordinates on Fanuc and Haas: write @ for the radius and ^ for the angle",
    ),
    (220, "a forbidden zone of Fanuc: the travel stands in the machine file"),
    (230, "the end of a forbidden zone of Fanuc: leave it out"),
    (270, "a check of the reference point on Fanuc: leave it out"),
    (
        290,
        "the way back from G28 on Fanuc, or a 3D printer's levelling: write where to go with G0",
    ),
    (
        310,
        "the skip of Fanuc and Haas: write G38.2, or G38.3 where no contact is no mistake",
    ),
    (320, "a thread in one cut on Fanuc lathes: write G33 with K"),
    (
        340,
        "a thread of growing pitch: it has no like here, write G33 for each pitch",
    ),
    (
        360,
        "the measuring of a tool on Fanuc lathes: write o<probe-tool-length> call",
    ),
    (
        370,
        "the measuring of a tool on Fanuc and Haas: write o<probe-tool-length> call",
    ),
    (
        380,
        "no probing move without its kind: write G38.2, G38.3, G38.4 or G38.5",
    ),
    (
        435,
        "tool-centre-point control by vectors: write G43.4 and angles of the rotary axes",
    ),
    (
        440,
        "a length offset downwards: write G43, and the length with the other sign into the tool table",
    ),
    (
        450,
        "an offset of one move on old controls: it has no like here, write G41 or G42",
    ),
    (
        460,
        "an offset of one move on old controls: it has no like here, write G41 or G42",
    ),
    (
        470,
        "an offset of one move on old controls: it has no like here, write G41 or G42",
    ),
    (
        480,
        "an offset of one move on old controls: it has no like here, write G41 or G42",
    ),
    (
        500,
        "the greatest speed of the spindle on lathes: write D of G96; on mills it ends scaling: leave it out",
    ),
    (501, "the end of a mirror image: leave it out"),
    (510, "scaling: it has no like here, post the part in its size"),
    (511, "a mirror image: it has no like here, post the part mirrored"),
    (
        531,
        "the turn to a tilted plane of Fanuc: write the angles of the rotary axes",
    ),
    (
        541,
        "further work systems of Fanuc and Haas: write G59.1, G59.2 or G59.3, with which there are nine",
    ),
    (
        600,
        "the approach from one side on Fanuc: it has no like here, write two moves",
    ),
    (
        620,
        "slower corners on Fanuc: inside_corner_feed of the machine file does that under G41 and G42",
    ),
    (
        630,
        "tapping on other controls: write G84, or G33.1 for a tap without a floating holder",
    ),
    (
        650,
        "the call of a macro on Fanuc and Haas: write o<name> call [..] [..]",
    ),
    (
        660,
        "a macro behind every move on Fanuc: it has no like here, write o<name> call [..] behind each",
    ),
    (670, "the end of G66 on Fanuc: leave it out"),
    (
        680,
        "a turned work system on Fanuc and Haas: write G10 L2 P0 R with the angle, about the origin of the system",
    ),
    (
        682,
        "a tilted plane of Fanuc: it has no like here, post for the rotary axes (G43.4)",
    ),
    (
        683,
        "a tilted plane of Fanuc: it has no like here, post for the rotary axes (G43.4)",
    ),
    (
        684,
        "a tilted plane of Fanuc: it has no like here, post for the rotary axes (G43.4)",
    ),
    (
        690,
        "the end of a turned work system on Fanuc and Haas: write G10 L2 P0 R0",
    ),
    (691, "the end of a tilted plane: leave it out"),
    (750, "a grooving cycle of lathes: it has no like here, write its moves"),
    (
        770,
        "a turning cycle of Fanuc lathes: write its moves, or G71 and the profile",
    ),
    (
        780,
        "a thread of Fanuc lathes: write G76 in this control's words, or G33 for each pass",
    ),
    (
        790,
        "a facing cycle of Fanuc lathes: write its moves, or G72 and the profile",
    ),
    (842, "rigid tapping of Fanuc: write G33.1 with K"),
    (843, "rigid left-hand tapping of Fanuc: write G33.1 with K, and M4"),
    (1030, "a limit of the look-ahead on Haas: leave it out"),
    (
        1070,
        "cylindrical interpolation of Fanuc and Haas: it has no like here, post the moves for the rotary axis",
    ),
    (
        1100,
        "a further work system of Haas, or a pole of Sinumerik: write one of G54 to G59.3, or @ and ^",
    ),
    (
        1110,
        "a further work system of Haas, or a pole of Sinumerik: write one of G54 to G59.3, or @ and ^",
    ),
    (
        1120,
        "polar interpolation of Fanuc and Haas, or a pole of Sinumerik: it has no like here, post X and Y",
    ),
    (
        1130,
        "the end of polar interpolation of Fanuc and Haas, which has no like here",
    ),
    (
        1360,
        "a measuring of the work on Haas: write o<probe-edge> call or another probing cycle",
    ),
    (1430, "tool-centre-point control of Haas: write G43.4"),
    (1500, "a pocket of Haas: it has no like here, post its moves"),
    (1530, "machine coordinates of Sinumerik: write G53 with G0 or G1"),
    (1540, "further work systems of Haas: write one of G54 to G59.3"),
    (1870, "how smooth Haas moves: write G64 P with the tolerance"),
    (2340, "tool-centre-point control of Haas: write G43.4"),
    (
        4500,
        "corners under compensation on Sinumerik: cutter_corner of the machine file says that",
    ),
    (
        4510,
        "corners under compensation on Sinumerik: cutter_corner of the machine file says that",
    ),
    (
        5000,
        "no work system on Sinumerik: write G53 on each line that means the machine",
    ),
    (6010, "an exact stop of Sinumerik: write G61.1"),
    (6020, "an exact stop of Sinumerik: write G61.1"),
    (6410, "rounded corners of Sinumerik: write G64 P with the tolerance"),
    (6420, "rounded corners of Sinumerik: write G64 P with the tolerance"),
    (6450, "rounded corners of Sinumerik: write G64 P with the tolerance"),
];

/// M codes of other controls, ascending.
const M_CODES: &[(u32, &str)] = &[
    (10, "a clamp of other controls: write M64 P with the output that clamps"),
    (11, "a clamp of other controls: write M65 P with the output that clamps"),
    (13, "spindle and coolant at once: write M3 and M8"),
    (14, "spindle and coolant at once: write M4 and M8"),
    (17, "the end of a subprogram on Sinumerik: write M99, or o<name> endsub"),
    (18, "motors off on a 3D printer, or the end of M19: write M5"),
    (23, "how threads end on Fanuc lathes: write L and E of G76"),
    (24, "how threads end on Fanuc lathes: write L and E of G76"),
    (
        29,
        "rigid tapping of Fanuc: write G33.1 with K instead of it and its G84",
    ),
    (31, "a chip conveyor: write M64 P with its output"),
    (33, "a chip conveyor: write M65 P with its output"),
    (
        41,
        "a gear: leave it out, or write M64 P with an output that changes it",
    ),
    (
        42,
        "a gear: leave it out, or write M64 P with an output that changes it",
    ),
    (
        43,
        "a gear: leave it out, or write M64 P with an output that changes it",
    ),
    (
        44,
        "a gear: leave it out, or write M64 P with an output that changes it",
    ),
    (82, "the filament of a 3D printer: this is a file for such a printer"),
    (83, "the filament of a 3D printer: this is a file for such a printer"),
    (84, "motors off on a 3D printer: leave it out, M2 ends the program"),
    (
        88,
        "coolant through the spindle on Haas: write M64 P with its output, or M7",
    ),
    (
        89,
        "coolant through the spindle on Haas: write M65 P with its output, or M9",
    ),
    (96, "an interrupting macro of Fanuc: it has no like here"),
    (
        97,
        "a subprogram in the same file on Haas, by line: write o<name> sub and o<name> call, or M98 P with an O-number",
    ),
];

/// What the G code of this number is elsewhere, and what to write here.
pub(crate) fn g_code(number: f64) -> Option<&'static str> {
    named(G_CODES, number * 10.0)
}

/// The same of an M code.
pub(crate) fn m_code(number: f64) -> Option<&'static str> {
    named(M_CODES, number)
}

fn named(codes: &[(u32, &'static str)], wanted: f64) -> Option<&'static str> {
    let same = |(code, _): &&(u32, &str)| (f64::from(*code) - wanted).abs() < 1e-3;
    codes.iter().find(same).map(|(_, what)| *what)
}

/// A language for machines that is not this one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// Heidenhain's own.
    Conversational,
    /// Fanuc's conditions and jumps.
    MacroB,
    /// Siemens' programs (MPF, SPF).
    Sinumerik,
    /// Klipper's macros and commands.
    Klipper,
    /// G-code for a 3D printer.
    Printer,
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Language::Conversational => {
                "this is Heidenhain's conversational language, not ISO G-code: post the part for LinuxCNC or ISO"
            }
            Language::MacroB => {
                "this is Macro B of Fanuc and Haas: write o1 if [..] and o1 endif, o1 while [..] and o1 endwhile; there is no GOTO"
            }
            Language::Sinumerik => "this is a program for Sinumerik, not ISO G-code: post the part for LinuxCNC or ISO",
            Language::Klipper => "this is for Klipper, which runs 3D printers, not for a machine tool: post the part for LinuxCNC",
            Language::Printer => "this is a file for a 3D printer (heaters, filament), not for a machine tool: post the part for LinuxCNC",
        })
    }
}

/// M codes that heat the nozzle or the bed of a printer. Where a machine has such codes of its own, nothing is wrong with them.
const HEATERS: [u8; 4] = [104, 109, 140, 190];

/// The language of a line that is wrong in this way, if it is plainly another one.
pub(crate) fn language(line: &[u8], wrong: &ErrorKind) -> Option<Language> {
    match wrong {
        ErrorKind::NoSuchUserCode { number } if HEATERS.contains(number) => return Some(Language::Printer),
        ErrorKind::UnusedWord { letter: 'E', .. } if extrudes(line) => return Some(Language::Printer),
        _ => {}
    }
    let text = String::from_utf8_lossy(line).to_ascii_uppercase();
    let text = text.trim_start_matches(|letter: char| letter.is_ascii() && is_blank(letter as u8));
    let has_n = text.starts_with('N') && text[1..].starts_with(|letter: char| letter.is_ascii_digit());
    let unnumbered =
        text[usize::from(has_n)..].trim_start_matches(|letter: char| letter.is_ascii_digit() || letter == ' ');
    let has_number = !has_n && unnumbered.len() < text.len();
    let compact: String = unnumbered.chars().filter(|letter| *letter != ' ').collect();
    let begins = |starts: &[&str]| starts.iter().any(|start| unnumbered.starts_with(start));
    let joined = |starts: &[&str]| starts.iter().any(|start| compact.starts_with(start));

    const PHRASES: [&str; 9] = [
        "BEGIN PGM",
        "END PGM",
        "BLK FORM",
        "TOOL CALL",
        "TOOL DEF",
        "CYCL DEF",
        "CYCL CALL",
        "CALL LBL",
        "CALL PGM",
    ];
    const WORDS: [&str; 14] = [
        "L ", "LN ", "LP ", "CC ", "C ", "CR ", "CT ", "CP ", "RND ", "CHF ", "APPR ", "DEP ", "LBL ", "FN ",
    ];
    if begins(&PHRASES) || has_number && begins(&WORDS) {
        return Some(Language::Conversational);
    }
    const SINUMERIK: [&str; 26] = [
        "%_N_",
        "DEFINT",
        "DEFREAL",
        "DEFBOOL",
        "DEFSTRING",
        "PROC",
        "MCALL",
        "GOTOF",
        "GOTOB",
        "CYCLE",
        "POCKET",
        "HOLES",
        "TRANS",
        "ATRANS",
        "AROT",
        "SUPA",
        "STOPRE",
        "EXTCALL",
        "TRAORI",
        "TRAFOOF",
        "WORKPIECE",
        "MSG(",
        "$P_",
        "$TC_",
        "T=",
        "BRISK",
    ];
    let assigns_axis = compact.split('=').next().is_some_and(|left| {
        let mut letters = left.chars().rev();
        matches!(letters.next(), Some('X' | 'Y' | 'Z' | 'A' | 'B' | 'C' | 'F' | 'S')) && !left.contains(['#', '['])
    });
    let jumps = compact.contains("GOTOF") || compact.contains("GOTOB");
    if joined(&SINUMERIK) || compact.contains('=') && assigns_axis || jumps {
        return Some(Language::Sinumerik);
    }
    let ends = compact
        .strip_prefix("END")
        .is_some_and(|rest| rest.starts_with(|letter: char| letter.is_ascii_digit()));
    if joined(&["IF[", "WHILE[", "GOTO", "DPRNT", "BPRNT", "POPEN", "PCLOS"]) || ends {
        return Some(Language::MacroB);
    }
    let name = |letter: char| letter.is_ascii_uppercase() || letter.is_ascii_digit() || letter == '_';
    let command = text.split(|letter| !name(letter)).next().unwrap_or_default();
    let is_command =
        command.trim_matches('_').contains('_') && command.starts_with(|letter: char| letter.is_ascii_uppercase());
    if is_command || text.starts_with('{') || text.contains("{%") || text.starts_with("[GCODE_MACRO") {
        return Some(Language::Klipper);
    }
    None
}

/// Whether a line has a move by which a printer lets plastic out.
fn extrudes(line: &[u8]) -> bool {
    let compact: Vec<u8> = line
        .iter()
        .filter(|octet| !is_blank(**octet))
        .map(u8::to_ascii_uppercase)
        .collect();
    let mut places = compact.windows(3).map(|three| {
        let is_move = three[0] == b'G' && matches!(three[1], b'0' | b'1') && !three[2].is_ascii_digit();
        is_move || (three[0] == b'G' && three[1] == b'0' && three[2] == b'1')
    });
    places.any(|is_move| is_move)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Settings, check};

    #[test]
    fn tables_ascend_and_hold_no_code_of_ours() {
        assert!(G_CODES.is_sorted_by(|a, b| a.0 < b.0));
        assert!(M_CODES.is_sorted_by(|a, b| a.0 < b.0));
        for (tenths, what) in G_CODES {
            let told = crate::code::GCode::from_number(f64::from(*tenths) / 10.0)
                .unwrap_err()
                .to_string();
            assert!(told.ends_with(what), "{told}");
        }
        for (number, what) in M_CODES {
            let told = crate::code::MCode::from_number(f64::from(*number))
                .unwrap_err()
                .to_string();
            assert!(told.ends_with(what), "{told}");
        }
    }

    #[test]
    fn a_text_in_another_language_is_named_once() {
        use Language::{Conversational, Klipper, MacroB, Printer, Sinumerik};
        for (text, line, language) in [
            (
                "0 BEGIN PGM PART MM\n1 TOOL CALL 1 Z S5000\n2 L X-10 Y+50 R0 FMAX M3\n",
                1,
                Conversational,
            ),
            ("G21\n12 L X+10 Y+20 F500\n13 CC X+0 Y+0\n", 2, Conversational),
            ("%_N_PART_MPF\nN10 G54\nN20 T=\"MILL\"\n", 1, Sinumerik),
            ("N10 G54 G90\nN20 DEF REAL DEPTH=5\n", 2, Sinumerik),
            ("N10 G0 X=R1 Y=IC(5)\n", 1, Sinumerik),
            ("CYCLE81(10,0,2,-5,)\nMCALL\n", 1, Sinumerik),
            ("N30 IF R1<5 GOTOB AGAIN\n", 1, Sinumerik),
            ("#100=1\nWHILE [#100 LT 5] DO1\n#100=#100+1\nEND1\n", 2, MacroB),
            ("#1=1\nIF[#1EQ1]GOTO10\n", 2, MacroB),
            ("G1 X1 F1\nN10 GOTO 5\nM30\n", 2, MacroB),
            ("G28\nPRINT_START BED=60 EXTRUDER=210\nG1 X1 E1\n", 2, Klipper),
            ("[gcode_macro HOME]\ngcode:\n {% set x = 1 %}\n", 1, Klipper),
            ("M104 S210\nG28\nG1 X50 Y50 E3.1 F1500\nM84\n", 1, Printer),
            ("G1 F1500 X50 E3.1\nG01X1E2\nM2\n", 1, Printer),
        ] {
            let errors = check(
                text.as_bytes(),
                Settings {
                    user_codes: Some(Vec::new()),
                    ..Settings::default()
                },
            );
            let told: Vec<_> = errors.iter().map(|error| (error.line, error.kind.clone())).collect();
            assert_eq!(told, [(line, ErrorKind::OtherLanguage(language))], "{text}");
        }
    }

    #[test]
    fn a_mistake_in_this_language_stays_one() {
        for text in [
            "G1 X1 F1 Q5\nM2\n",
            "O1 if [1\nM2\n",
            "G0 X\nM2\n",
            "#1 = [1 = 1]\nM2\n",
            "M66 E1 L3 Q1\nM2\n",
            "G1 X1 (a\nM2\n",
            "GO X1\nM2\n",
            "/ N5 G0 Q1\nM2\n",
            "o<a> if [1]\no<a> endi\nM2\n",
            "G0 T1 = 5\nM2\n",
            "G0 X#<no_name>\nM2\n",
            "M150\nM2\n",
        ] {
            let errors = check(
                text.as_bytes(),
                Settings {
                    user_codes: Some(Vec::new()),
                    ..Settings::default()
                },
            );
            assert!(!errors.is_empty(), "{text}");
            for error in errors {
                assert!(!matches!(error.kind, ErrorKind::OtherLanguage(_)), "{text}: {error}");
            }
        }
    }
}
