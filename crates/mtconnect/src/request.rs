//! What a client asks for: a path and a query.

use crate::document::Refusal;

/// Observations of one answer at the most.
pub const MAX_COUNT: u64 = 10_000;
/// Observations of an answer that names no number.
const COUNT: u64 = 100;
/// Milliseconds between two parts of a stream at the most: a day.
const INTERVAL_MAX: u64 = 86_400_000;
/// Milliseconds between two signs of life.
const HEARTBEAT: u64 = 10_000;

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Probe,
    Current {
        at: Option<u64>,
    },
    Sample {
        from: Option<u64>,
        to: Option<u64>,
        count: u64,
    },
    Assets {
        kind: Option<String>,
        count: usize,
    },
    Asset(Vec<String>),
}

/// A request that can be read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Request {
    pub(crate) device: Option<String>,
    pub(crate) kind: Kind,
    pub(crate) path: Option<String>,
    /// ms; a stream is wanted.
    pub(crate) interval: Option<u64>,
    /// ms.
    pub(crate) heartbeat: u64,
}

/// `path` without what stands before the request of MTConnect: `/probe`, `/mill/current`, `/asset/T1;T2`.
pub(crate) fn read(path: &str, query: &str) -> Result<Request, (Refusal, String)> {
    let parts: Vec<&str> = path.trim_matches('/').split('/').collect();
    let refused = || {
        (
            Refusal::InvalidUri,
            format!("{path} is none of /probe, /current, /sample, /assets, /asset/ID"),
        )
    };
    let (device, rest) = match parts.as_slice() {
        [first, ..] if is_request(first) => (None, &parts[..]),
        [device, second, ..] if is_request(second) => (Some(decoded(device)), &parts[1..]),
        // A device alone means its model.
        [device] if !device.is_empty() => (Some(decoded(device)), &["probe"][..]),
        [""] => (None, &["probe"][..]),
        _ => return Err(refused()),
    };
    let query = parameters(query);
    let text = |name: &str| {
        query
            .iter()
            .find(|(known, _)| known == name)
            .map(|(_, value)| value.clone())
    };
    let number = |name: &str, limits: [u64; 2]| match text(name) {
        None => Ok(None),
        Some(value) => match value.parse::<u64>() {
            Ok(number) if (limits[0]..=limits[1]).contains(&number) => Ok(Some(number)),
            _ => {
                let [low, high] = limits;
                let message = format!("{name} is a number from {low} to {high}, got {value}");
                let name = name.to_owned();
                let limits = Some(limits);
                Err((Refusal::Value { name, value, limits }, message))
            }
        },
    };
    let kind = match rest {
        ["probe"] => Kind::Probe,
        ["current"] => Kind::Current {
            at: number("at", [0, u64::MAX])?,
        },
        ["sample"] => Kind::Sample {
            from: number("from", [0, u64::MAX])?,
            to: number("to", [0, u64::MAX])?,
            count: number("count", [1, MAX_COUNT])?.unwrap_or(COUNT),
        },
        ["assets"] | ["asset"] => Kind::Assets {
            kind: text("type"),
            count: number("count", [1, MAX_COUNT])?.unwrap_or(MAX_COUNT) as usize,
        },
        ["asset" | "assets", ids] => Kind::Asset(decoded(ids).split(';').map(str::to_owned).collect()),
        _ => return Err(refused()),
    };
    let interval = number("interval", [0, INTERVAL_MAX])?;
    if matches!(kind, Kind::Current { at: Some(_) }) && interval.is_some() {
        let message = "at and interval exclude each other".to_owned();
        return Err((Refusal::Unsupported, message));
    }
    Ok(Request {
        device,
        kind,
        path: text("path"),
        interval,
        heartbeat: number("heartbeat", [1, INTERVAL_MAX])?.unwrap_or(HEARTBEAT),
    })
}

fn is_request(part: &str) -> bool {
    matches!(part, "probe" | "current" | "sample" | "asset" | "assets")
}

fn parameters(query: &str) -> Vec<(String, String)> {
    let pairs = query.split('&').filter(|pair| !pair.is_empty());
    pairs
        .map(|pair| {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            (decoded(name), decoded(value))
        })
        .collect()
}

/// `%41` is A, `+` a space.
fn decoded(text: &str) -> String {
    let octets = text.as_bytes();
    let (mut out, mut at) = (Vec::with_capacity(octets.len()), 0);
    while at < octets.len() {
        let digits = octets.get(at + 1..at + 3).filter(|_| octets[at] == b'%');
        let value = digits.and_then(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        match (octets[at], value) {
            (_, Some(value)) => {
                out.push(value);
                at += 2;
            }
            (b'+', None) => out.push(b' '),
            (octet, None) => out.push(octet),
        }
        at += 1;
    }
    String::from_utf8_lossy(&out).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn kind(path: &str, query: &str) -> Kind {
        read(path, query).unwrap().kind
    }

    #[test]
    fn requests_name_a_device_or_none() {
        assert_eq!(kind("/probe", ""), Kind::Probe);
        assert_eq!(kind("/", ""), Kind::Probe);
        let of_device = read("/my%20mill/current", "at=5").unwrap();
        assert_eq!(
            (of_device.device.as_deref(), of_device.kind),
            (Some("my mill"), Kind::Current { at: Some(5) })
        );
        assert_eq!(read("/mill", "").unwrap().device.as_deref(), Some("mill"));
        assert_eq!(kind("/asset/T1;T%32", ""), Kind::Asset(vec!["T1".into(), "T2".into()]));
    }

    #[test]
    fn parameters_have_their_limits() {
        let sample = read(
            "/sample",
            "from=3&count=7&path=//X%5b%40a%3D%22b%22%5D&interval=0&heartbeat=1000",
        )
        .unwrap();
        assert_eq!(
            sample.kind,
            Kind::Sample {
                from: Some(3),
                to: None,
                count: 7
            }
        );
        assert_eq!(sample.path.as_deref(), Some("//X[@a=\"b\"]"));
        assert_eq!((sample.interval, sample.heartbeat), (Some(0), 1000));
        let told = |path: &str, query: &str| read(path, query).unwrap_err();
        assert_eq!(told("/sample", "count=0").1, "count is a number from 1 to 10000, got 0");
        assert!(matches!(told("/sample", "from=x").0, Refusal::Value { .. }));
        assert!(matches!(told("/a/b/c", "").0, Refusal::InvalidUri));
        assert!(matches!(told("/probe/x", "").0, Refusal::InvalidUri));
        assert!(matches!(told("/current", "at=1&interval=5").0, Refusal::Unsupported));
    }

    proptest! {
        #[test]
        fn anything_is_answered(path in any::<String>(), query in "[a-z=&%0-9]{0,40}") {
            let _ = read(&path, &query);
        }
    }
}
