from volery.cost.native.llvm_ir import (
    BasicBlock,
    basic_blocks,
    critical_edges,
    retarget,
    with_counters,
    with_trace_calls,
)

TEXT = """\
target datalayout = "e-m:e"
target triple = "x86_64-pc-linux-gnu"
define dso_local i32 @step(i32 noundef %x) local_unnamed_addr #0 personality ptr @gxx {
entry:
  %cmp = icmp sgt i32 %x, 0
  br i1 %cmp, label %"odd name", label %exit
"odd name":
  %once = phi i32 [ %x, %entry ]
  %y = mul i32 %once, 3
  invoke void @far() to label %exit unwind label %lpad
lpad:
  %caught = landingpad { ptr, i32 }
          cleanup, !dbg !3
  br label %exit
exit:
  %r = phi i32 [ 0, %entry ], [ 1, %"odd name" ], [ 2, %lpad ]
  ret i32 %r
}
define void @bare() {
  ret void
}
attributes #0 = { "target-cpu"="x86-64" "tune-cpu"="generic" }
"""


def test_blocks_are_found_in_order_with_and_without_labels():
    assert basic_blocks(TEXT) == [
        BasicBlock("step", "entry", True),
        BasicBlock("step", "odd name"),
        BasicBlock("step", "lpad"),
        BasicBlock("step", "exit"),
        BasicBlock("bare", "", True),
    ]


def test_a_counter_follows_phi_instructions():
    lines = with_counters(TEXT).splitlines()
    landing = lines.index("          cleanup, !dbg !3")
    assert lines[landing + 1].startswith("  %volery.seen.2 = load i64")
    phi = next(number for number, line in enumerate(lines) if line.startswith("  %r = phi"))
    assert lines[phi + 1].startswith("  %volery.seen.3 = load i64")


def test_the_array_has_one_counter_for_each_block():
    assert "@volery_counters = alias [5 x i64]" in with_counters(TEXT)
    assert "@volery_counters_length = constant i64 5" in with_counters(TEXT)


def test_a_trace_calls_with_the_number_of_each_block():
    assert [f"@volery_trace(i32 {number})" in with_trace_calls(TEXT) for number in range(6)] == [True] * 5 + [
        False
    ]


def test_retargeted_code_has_no_processor_attributes():
    text = retarget(TEXT, "aarch64-unknown-linux-gnu", "e-m:e-i8:8:32")
    assert 'target triple = "aarch64-unknown-linux-gnu"' in text
    assert 'target datalayout = "e-m:e-i8:8:32"' in text
    assert "target-cpu" not in text
    assert "{ }" not in text  # a group of attributes may not be empty


def test_a_trace_records_the_value_of_each_switch():
    text = """\
define void @choose(i8 %small, i32 %word, i64 %"large one") {
entry:
  switch i8 %small, label %next [
    i8 9, label %next
  ]
next:
  switch i32 %word, label %last []
last:
  switch i64 %"large one", label %end []
end:
  ret void
}
"""
    lines = with_trace_calls(text).splitlines()
    for switch, calls in (
        (
            "  switch i8 %small, label %next [",
            ["zext i8 %small to i32", "@volery_switch(i32 %volery.switch."],
        ),
        ("  switch i32 %word, label %last []", ["@volery_trace(i32 1)", "@volery_switch(i32 %word)"]),
        (
            '  switch i64 %"large one", label %end []',
            ['trunc i64 %"large one" to i32', "@volery_switch(i32 %v"],
        ),
    ):
        at = lines.index(switch)
        assert [text in line for text, line in zip(calls, lines[at - 2 : at], strict=True)] == [True, True]


def test_critical_edges_are_found_with_their_source_block():
    text = """\
define void @choose(i1 %one) {
entry:
  br i1 %one, label %entry.end_crit_edge, label %next
entry.end_crit_edge:
  br label %end
next:
  switch i32 1, label %"next x.end_crit_edge" [
    i32 4, label %end
  ]
"next x.end_crit_edge":
  br label %end
end:
  ret void
}
"""
    assert critical_edges(text) == {1: 0, 3: 2}
