//! A scan asks nothing of the allocator, whatever the program does and whatever goes wrong in it.

use crate::common;
use crate::counting;

use common::start;
use counting::calls;

#[test]
fn a_scan_allocates_nothing() {
    let mut runtime = start(
        "TYPE S : STRUCT a : INT; l : ARRAY[1..3] OF REAL; END_STRUCT; END_TYPE
         FUNCTION f : LREAL VAR_INPUT x : LREAL; END_VAR VAR t : ARRAY[1..4] OF INT := [4(2)]; END_VAR
             f := SQRT(ABS(x)) + SIN(x) + INT_TO_LREAL(t[2]);
         END_FUNCTION
         FUNCTION_BLOCK B VAR_INPUT go : BOOL; END_VAR VAR_IN_OUT s : S; END_VAR VAR t : TON; c : CTU; END_VAR
             t(IN := go, PT := T#20ms); c(CU := t.Q, PV := 3); s.a := s.a + c.CV;
         END_FUNCTION_BLOCK
         PROGRAM p VAR_INPUT i : INT; END_VAR VAR b : ARRAY[1..2] OF B; s, u : S; x : LREAL; text : STRING; short : STRING[2]; ok : BOOL; w : WORD; n : INT; END_VAR
             b[i](go := i = 1, s := s); u := s; x := f(f(x));
             u.l[i] := 7 / i; n := MUX(i, 1, 2); text := SEL(i = 1, 'off', 'on');
             short := text; ok := short > text AND GT(i, n, 1); w := UINT_TO_BCD_WORD(INT_TO_UINT(i) * 3000);
             WHILE n < 30000 DO n := n + i; END_WHILE;
             CASE i OF 1: n := LREAL_TO_INT(x * 1.0E9); 2..5: n := 0; ELSE n := n * n; END_CASE;
         END_PROGRAM",
    );
    let logic = runtime.logic().clone();
    let input = logic.variable("i").unwrap();
    let allocations = calls(|| {
        for call in 0..1000_i64 {
            runtime.set(input, logic::Value::Integer(i128::from(call % 7)));
            runtime.scan(call * 10_000_000);
        }
    });
    assert_eq!(allocations, 0);
    assert!(runtime.faults() > 0 && runtime.overflows() > 0);
}
