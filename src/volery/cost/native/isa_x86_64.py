"""Effects of x86-64 instructions in Intel's notation: SSE2, and AVX and BMI in the same forms."""

from __future__ import annotations

import re
from dataclasses import replace

from volery.cost.native.machine_code import NO_MEMORY, Effect, Instruction, MemoryOperand

FLAGS = "flags"

_LEGACY = (
    ("rax", "eax", "ax", "al", "ah"), ("rbx", "ebx", "bx", "bl", "bh"), ("rcx", "ecx", "cx", "cl", "ch"),
    ("rdx", "edx", "dx", "dl", "dh"), ("rsi", "esi", "si", "sil"), ("rdi", "edi", "di", "dil"),
    ("rbp", "ebp", "bp", "bpl"), ("rsp", "esp", "sp", "spl"),
)  # fmt: skip
_REGISTERS = {name: names[0] for names in _LEGACY for name in names}
_REGISTERS |= {f"r{n}{suffix}": f"r{n}" for n in range(8, 16) for suffix in ("", "d", "w", "b")}
_REGISTERS |= {f"{kind}mm{n}": f"xmm{n}" for n in range(16) for kind in "xy"}
_WORD = re.compile(r"[a-z]\w*")
_SIZES = {"byte": 1, "word": 2, "dword": 4, "qword": 8, "xmmword": 16, "ymmword": 32}
_DISPLACEMENT = re.compile(r" ([+-]) (\d+)(?=\])")

_VECTOR_MOVE = re.compile(r"v?mov(?:[ahlu]p[sd]|s[sd]|dq[au]|[dq]|lhps|hlps|nt\w*|ddup|s[lh]dup)$")
_ZEROING = re.compile(r"v?(?:xorp[sd]|pxor|psub[bwdq]|pcmpgt[bwdq])$|xor$|sub$")
_HALVES = {"movlps", "movhps", "movlpd", "movhpd"}
_COMPARES = re.compile(r"cmp$|test$|v?u?comis[sd]$|bt$|v?ptest$")
_OVERWRITES = re.compile(
    r"v\w+$|lea$|movz\w$|movs\wd?$|set\w+$|bs[fr]$|[tl]zcnt$|popcnt$|pshuf\w+$|sqrtp[sd]$|p?movmsk\w+$|pextrw$"
    r"|cvtt?s[sd]2si$|cvtt?p[sd]\w+$|cvtdq2p[sd]$"
)
_CONDITIONAL = re.compile(r"cmov|set|adc$|sbb$")
_KEEPS_FLAGS = re.compile(r"mov|cmov|set|lea$|not$|bswap$|.*[sp][sd]$|v|cvt|p(?!opcnt|test)|[sr]h\wx$")

_SCALAR = re.compile(r"v?(div|sqrt|mul|add|sub|min|max|cmp\w*|ucomi|comi)([sp])([sd])$")
_ARITHMETIC = {
    "add": "fp_add", "sub": "fp_add", "mul": "fp_multiply", "ucomi": "fp_flags", "comi": "fp_flags",
}  # fmt: skip
_NAMED = (
    (re.compile(r"v?fn?m(?:add|sub)"), "fp_fma"),
    (re.compile(r"v?cvt(?:t?s[sd]2si|si2s[sd])"), "convert_integer"),
    (re.compile(r"v?cvt"), "convert"),
    (
        re.compile(
            r"v?(?:p?shuf|p?unpck|pack|pinsr|pextr|ps[lr]ldq|palignr|insertps|p?blend|mov(?:lh|hl)ps)"
        ),
        "shuffle",
    ),
    (re.compile(r"v?p(?:mul|madd|sadbw)"), "vector_multiply"),
    (re.compile(r"v?ps(?:ll|rl|ra)[wdq]$"), "vector_shift"),
    (re.compile(r"v?p?movmsk"), "transfer"),
)


def effect(one: Instruction) -> Effect:
    """Return the effect of an instruction; an unknown mnemonic is one simple operation on its operands."""
    name, operands = one.mnemonic, one.operands
    special = _SPECIAL.get(name)
    if special is not None:
        return _call(special, operands[0]) if name == "call" and operands else special
    if name in ("push", "pop"):
        registers = _registers(operands)
        return (
            Effect(store="store", reads=registers)
            if name == "push"
            else Effect(load="load", writes=registers)
        )
    if name.startswith("j"):
        return Effect(operation="branch", reads=_registers(operands) if name == "jmp" else (FLAGS,))
    return _computing(name, operands)


def _call(call: Effect, target: str) -> Effect:
    """Return the effect of a call: the address of its target is in memory, in a register or in itself."""
    if "[" in target:
        return replace(call, load="load", store="", memory=_memory(target))  # one address an instruction
    return replace(call, reads=_registers((target,)))


def _computing(name: str, operands: tuple[str, ...]) -> Effect:
    if name in ("mul", "imul", "div", "idiv") and len(operands) == 1:
        return _implicit(name, operands[0])
    if name in ("mov", "movabs") or _VECTOR_MOVE.match(name):
        return _move(name, operands)
    if _ZEROING.match(name) and len(operands) == 2 and operands[0] == operands[1]:
        return Effect(writes=(*_registers(operands[:1]), *((FLAGS,) if name in ("xor", "sub") else ())))
    return _ordinary(name, operands)


_SPECIAL = {
    "call": Effect(operation="branch", store="store"),
    "ret": Effect(operation="branch", load="load"),
    "ud2": Effect(),
    "nop": Effect(),
    "cdq": Effect(operation="alu", reads=("rax",), writes=("rdx",)),
    "cqo": Effect(operation="alu", reads=("rax",), writes=("rdx",)),
    "cdqe": Effect(operation="alu", reads=("rax",), writes=("rax",)),
    "cwde": Effect(operation="alu", reads=("rax",), writes=("rax",)),
}


def _implicit(name: str, operand: str) -> Effect:
    """Return the effect of a product or quotient in ``rdx:rax``."""
    wide = "qword" in operand or _REGISTERS.get(operand) == operand
    divides = "div" in name
    return Effect(
        slots=4.0 if divides else 2.0,
        load="load" if "[" in operand else "",
        operation=("divide64" if wide else "divide32") if divides else "multiply",
        memory=_memory(operand),
        reads=("rax", "rdx", *_register_operands((operand,))),
        writes=("rax", "rdx", FLAGS),
    )


def _move(name: str, operands: tuple[str, ...]) -> Effect:
    into, out = operands[0], operands[-1]
    vector = name not in ("mov", "movabs")
    if "[" in into:
        store = "store_vector" if "mm" in out else "store"
        return Effect(store=store, reads=_registers((out,)), memory=_memory(into))
    writes, reads = _registers((into,)), _registers((out,))
    if "[" in out:
        half = name in _HALVES
        return Effect(
            load="load_vector" if vector else "load",
            operation="shuffle" if half else "",
            reads=writes if half else (),
            writes=writes,
            memory=_memory(out),
        )
    if vector and ("mm" in into) != ("mm" in out):
        return Effect(operation="transfer", reads=reads, writes=writes)
    if name in ("movss", "movsd"):  # the upper part stays
        return Effect(operation="shuffle", reads=(*reads, *writes), writes=writes)
    if not reads:
        return Effect(operation="alu", writes=writes)
    return Effect(operation="vector_move" if vector else "move", reads=reads, writes=writes)


def _ordinary(name: str, operands: tuple[str, ...]) -> Effect:
    place = next((operand for operand in operands if "[" in operand), "")
    operation, times = _operation(name, operands)
    writes = () if _COMPARES.match(name) else _register_operands(operands[:1])
    if name == "lea":
        return Effect(operation=operation, reads=_registers((place,)), writes=writes)
    overwritten = bool(writes) and (_OVERWRITES.match(name) is not None or len(operands) == 3)
    reads = _register_operands(operands[1:] if overwritten else operands)
    if _CONDITIONAL.match(name):
        reads = (*reads, FLAGS)
    if not _KEEPS_FLAGS.match(name) or name.startswith(("ucomi", "comi")):
        writes = (*writes, FLAGS)
    stores = bool(place) and operands[0] == place and not _COMPARES.match(name)
    vector = any("mm" in operand for operand in operands)
    return Effect(
        slots=2.0 if stores or operation in ("convert", "convert_integer") else 1.0,
        load=("load_vector" if vector else "load") if place and not name.startswith("set") else "",
        operation=operation,
        times=times,
        store="store" if stores else "",
        memory=_memory(place),
        reads=reads,
        writes=writes,
    )


def _operation(name: str, operands: tuple[str, ...]) -> tuple[str, int]:
    """Return the class of the operation and their number: a packed quotient has half as many as parts."""
    if scalar := _SCALAR.match(name):
        kind, packed, width = scalar.groups()
        parts = (2 if width == "d" else 4) if packed == "p" else 1
        bits = "64" if width == "d" else "32"
        if kind in ("div", "sqrt"):
            return ("fp_divide" if kind == "div" else "fp_root") + bits, max(1, parts // 2)
        return _ARITHMETIC.get(kind, "fp_compare"), 1
    for pattern, operation in _NAMED:
        if pattern.match(name):
            return operation, 1
    if any(_REGISTERS.get(operand, "").startswith("xmm") for operand in operands):
        return "vector", 1
    return _integer_class(name, operands)


def _integer_class(name: str, operands: tuple[str, ...]) -> tuple[str, int]:
    if name == "imul":
        return "multiply", 1
    if name in ("inc", "dec") or (name in ("add", "sub") and operands[-1].lstrip("-").isdigit()):
        return ("increment" if "[" not in operands[0] else "alu"), 1
    if _CONDITIONAL.match(name):
        return "conditional", 1
    if name in ("shl", "shr", "sar", "sal", "rol", "ror", "shld", "shrd"):
        return "shift", 2 if operands[-1] == "cl" else 1
    if name == "lea" and operands[1].count("+") + operands[1].count("-") > 1 and "rip" not in operands[1]:
        return "shifted_alu", 1
    return "alu", 1


def _registers(operands: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(
        _REGISTERS[word] for operand in operands for word in _WORD.findall(operand) if word in _REGISTERS
    )


def _register_operands(operands: tuple[str, ...]) -> tuple[str, ...]:
    """Return the registers that are operands themselves, not parts of an address."""
    return _registers(tuple(operand for operand in operands if "[" not in operand))


def _memory(operand: str) -> MemoryOperand:
    if "[" not in operand:
        return NO_MEMORY
    place = operand[operand.index("[") :]
    match = _DISPLACEMENT.search(place)
    return MemoryOperand(
        _registers((operand,)),
        _DISPLACEMENT.sub("", place),
        int(match[1] + match[2]) if match else 0,
        _SIZES.get(operand.partition(" ")[0], 8),
    )
