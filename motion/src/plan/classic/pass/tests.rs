use super::*;
use proptest::prelude::*;
use std::sync::LazyLock;

/// Kept for all cases, as a planner keeps them.
static WORKERS: LazyLock<Vec<Workers>> =
    LazyLock::new(|| (0..=4).map(|threads| Workers::new(threads, || ())).collect());

/// Bits of the serial result.
fn expected(elements: &[Element]) -> Vec<u64> {
    let mut b = Vec::new();
    serial(elements, &mut b);
    bits(b)
}

fn run(elements: &Arc<[Element]>, chunk: usize, overlap: usize, threads: usize) -> Buffers {
    let mut buffers = Buffers::new(chunk, overlap, &WORKERS[threads]);
    buffers.run(elements).unwrap();
    buffers
}

fn bits(b: impl IntoIterator<Item = f64>) -> Vec<u64> {
    b.into_iter().map(f64::to_bits).collect()
}

/// Mostly what a machine does, sometimes what nothing does.
fn number(usual: Range<f64>) -> impl Strategy<Value = f64> {
    let strange = [
        0.0,
        -0.0,
        f64::MIN_POSITIVE,
        5e-324,
        1e-160,
        1e160,
        f64::MAX,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        -1.0,
    ];
    prop_oneof![60 => usual, 1 => prop::sample::select(strange.to_vec())]
}

prop_compose! {
    fn element(longest: f64)(
        length in number(1e-3..longest), acceleration in number(10.0..5000.0), feed in number(1.0..700.0),
        corner in number(0.0..700.0), sharp in 0u8..8,
    ) -> Element {
        // Most borders are no corners, so that the passes run over many elements.
        Element { length, acceleration, feed, corner: if sharp == 0 { corner } else { f64::INFINITY } }
    }
}

fn path() -> impl Strategy<Value = Vec<Element>> {
    prop_oneof![Just(0.05), Just(0.5), Just(50.0)]
        .prop_flat_map(|longest| prop::collection::vec(element(longest), 0..400))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn chunks_give_the_bits_of_the_serial_passes(
        elements in path(), chunk in 1usize..120, overlap in 0usize..60, threads in 0usize..5,
    ) {
        let elements: Arc<[Element]> = elements.into();
        let mut got = run(&elements, chunk, overlap, threads);
        prop_assert_eq!(bits(got.b()), expected(&elements));
        prop_assert_eq!(got.chunks().len(), (elements.len() + 1).div_ceil(chunk));
        // What the chunks needed does not depend on the threads either.
        prop_assert_eq!(got.chunks().to_vec(), run(&elements, chunk, overlap, 0).chunks().to_vec());
        // Nothing is left from one path to the next, shorter one.
        let part: Arc<[Element]> = elements[..elements.len() / 2].into();
        got.run(&part).unwrap();
        prop_assert_eq!(bits(got.b()), expected(&part));
    }

    #[test]
    fn every_element_can_be_run(elements in path()) {
        let mut b = Vec::new();
        serial(&elements, &mut b);
        prop_assert_eq!(b.len(), elements.len() + 1);
        prop_assert_eq!((b[0], b[elements.len()]), (0.0, 0.0));
        for (i, element) in elements.iter().enumerate() {
            prop_assert!(b[i] <= b[i + 1] + element.gain() && b[i + 1] <= b[i] + element.gain());
            prop_assert!(b[i].max(b[i + 1]) <= positive(element.feed).powi(2));
            prop_assert!(i + 1 == elements.len() || b[i + 1] <= positive(element.corner).powi(2));
        }
    }

    #[test]
    fn what_is_settled_stays_whatever_follows(elements in path(), more in path()) {
        let settled = settled(&elements);
        let known = expected(&elements);
        prop_assert!(settled <= elements.len());
        let longer: Vec<_> = elements.iter().chain(&more).copied().collect();
        prop_assert_eq!(&expected(&longer)[..settled], &known[..settled]);
    }
}

/// Like the property above with some extremes by hand: one chunk, chunks of one node, no path.
#[test]
fn odd_sizes_give_the_bits_of_the_serial_passes() {
    let element = |k: usize| Element {
        length: 0.1 + (k % 7) as f64 * 0.05,
        acceleration: 800.0,
        feed: 90.0,
        corner: if k.is_multiple_of(37) { 3.0 } else { 200.0 },
    };
    for count in [0, 1, 2, 3, 500] {
        let elements: Arc<[Element]> = (0..count).map(element).collect();
        let expected = expected(&elements);
        for (chunk, overlap) in [
            (0, 0),
            (1, 0),
            (1, 1),
            (2, 1000),
            (usize::MAX, 7),
            (17, usize::MAX),
            (500, 3),
        ] {
            let got = run(&elements, chunk, overlap, 2);
            assert_eq!(
                bits(got.b()),
                expected,
                "{count} elements, chunk {chunk}, overlap {overlap}"
            );
        }
    }
}

#[test]
fn a_hand_made_path_has_the_speeds_of_the_textbook() {
    // 2 a L = 200 per element; a corner of 10 mm/s in the middle.
    let element = |corner| Element {
        length: 0.1,
        acceleration: 1000.0,
        feed: 20.0,
        corner,
    };
    let elements = [99.0, 99.0, 10.0, 99.0, 99.0, 99.0].map(element);
    assert_eq!(expected(&elements), bits([0.0, 200.0, 300.0, 100.0, 300.0, 200.0, 0.0]));
    // Two elements are enough to brake from 20 mm/s to rest: what follows changes nothing further ahead.
    assert_eq!(settled(&elements), 5);
    assert_eq!((settled(&elements[..1]), settled(&[])), (1, 0));
}

/// 40 m/min, 3000 mm/s²: an overlap of 74.1 mm always holds a certificate, and nothing much shorter does.
#[test]
fn an_overlap_of_the_braking_length_is_enough() {
    let (feed, acceleration, length) = (40e3 / 60.0, 3000.0, 0.067);
    let braking_mm: f64 = feed * feed / (2.0 * acceleration);
    assert!((braking_mm - 74.074).abs() < 1e-3, "{braking_mm}");
    let overlap = (braking_mm / length).ceil() as usize;
    assert_eq!(overlap, 1106);
    let path = |corners: &[usize]| -> Arc<[Element]> {
        let element = |k: usize| Element {
            length,
            acceleration,
            feed,
            corner: if corners.contains(&k) { 1.0 } else { f64::INFINITY },
        };
        (0..20_000).map(element).collect()
    };
    let mut most = 0;
    // The first chunk ends right behind the node where braking to the corner at node 4104 begins.
    for corners in [
        vec![],
        vec![4103],
        vec![5000, 5600, 7000, 9000, 9001, 15_000],
        vec![1, 3000, 19_000],
    ] {
        let elements = path(&corners);
        let got = run(&elements, 3000, overlap, 2);
        assert_eq!(bits(got.b()), expected(&elements));
        for chunk in got.chunks() {
            assert!(chunk.redone == 0 && !chunk.handed_back, "{chunk:?}");
            most = most.max(chunk.left).max(chunk.right);
        }
    }
    assert_eq!(most, overlap - 1);
    // Less is too little somewhere: it is noticed, and the result is the same.
    let elements = path(&[4103]);
    let got = run(&elements, 3000, 50, 2);
    assert_eq!(bits(got.b()), expected(&elements));
    assert!(got.chunks().iter().any(|chunk| chunk.redone > 0));
    assert!(got.chunks().iter().all(|chunk| !chunk.handed_back));
}

#[test]
fn a_path_without_any_certificate_is_done_in_bounded_time() {
    let element = Element {
        length: 1e-3,
        acceleration: 100.0,
        feed: 1e6,
        corner: 1e6,
    };
    let elements: Arc<[Element]> = vec![element; 50_000].into();
    let got = run(&elements, 100, 10, 2);
    assert_eq!(bits(got.b()), expected(&elements));
    // Only the last chunks, which see the end of the path, know their speeds. All the others are handed back after an
    // overlap of 400, four chunks, on both sides.
    assert_eq!(got.chunks().iter().filter(|chunk| chunk.handed_back).count(), 496);
    assert!(got.chunks().iter().all(|chunk| chunk.redone <= 12));
}
