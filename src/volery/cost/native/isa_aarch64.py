"""Effects of AArch64 instructions (ARMv8-A with its vector unit)."""

from __future__ import annotations

import re

from volery.cost.native.machine_code import Effect, Instruction, MemoryOperand

FLAGS = "flags"

_REGISTER = re.compile(r"\b(?:([wx])(\d+|zr)|([bhsdqv])(\d+)|(w?sp))\b")
_WIDTHS = {"b": 1, "h": 2, "s": 4, "w": 4, "d": 8, "x": 8, "q": 16, "v": 16, "{": 32}
_NARROW = re.compile(r"(?:ld|st)u?r?s?([bh])")
_DISPLACEMENT = re.compile(r", #(-?\d+)(?=\])")

_COMPARES = {"cmp", "cmn", "tst", "fcmp", "fcmpe", "ccmp", "ccmn", "fccmp"}
_SETS_FLAGS_TOO = {"adds", "subs", "ands", "bics", "negs", "adcs", "sbcs"}
_READS_FLAGS = re.compile(
    r"(?:f?csel|cset|csetm|csinc|csinv|csneg|cinc|cinv|cneg|f?ccm[pn]|[as][db]c|ngc)s?$"
)
_READS_TARGET = re.compile(r"(?:movk|bfi|bfxil|ins|fml[as]|[su]?ml[as]l?2?|bsl|bi[tf]|xtn2|fcvtn2|sqxtn2)$")
_SHIFTED = re.compile(r"(?:lsl|lsr|asr|ror|[su]xt[bhwx])(?: #(\d+))?$")

_BRANCHES = {"ret": "branch", "b": "branch", "bl": "branch", "nop": "", "brk": "", "hint": "", "dmb": ""}
_INTEGER = (
    (re.compile(r"[su]div$"), "divide"),
    (re.compile(r"mul$|m(?:add|sub|neg)$|[su]mul[lh]$|[su]m(?:add|sub|neg)l$"), "multiply"),
    (re.compile(r"ls[lr]$|asr$|ror$|[us]bf|bfi$|bfxil$|extr$"), "shift"),
)
_VECTOR = (
    (re.compile(r"f(?:div|sqrt)$"), "quotient"),
    (re.compile(r"fn?mulx?$"), "fp_multiply"),
    (re.compile(r"fn?m(?:add|sub)$|fml[as]$"), "fp_fma"),
    (re.compile(r"fcvt|[su]cvtf|frint"), "convert"),
    (re.compile(r"f(?:add|sub|abd)"), "fp_add"),
    (re.compile(r"f(?:max|min|cm|ccm)"), "fp_compare"),
    (re.compile(r"[su]?m(?:ul|la|ls)|sqdmul"), "vector_multiply"),
    (re.compile(r"zip|uzp|trn|ext$|tb[lx]|dup|ins|rev|xtn|[su]shll"), "shuffle"),
)


def effect(one: Instruction) -> Effect:
    """Return the effect of an instruction; an unknown mnemonic is one simple operation on its operands."""
    name, operands = one.mnemonic, one.operands
    if name in _BRANCHES:
        return Effect(operation=_BRANCHES[name])
    if name in ("br", "blr", "cbz", "cbnz", "tbz", "tbnz"):
        return Effect(operation="branch", reads=_registers(operands[:1]))
    if name.startswith("b."):
        return Effect(operation="branch", reads=(FLAGS,))
    memory = next((number for number, one in enumerate(operands) if one.startswith("[")), None)
    if memory is not None and name.startswith(("ld", "st", "prf")):
        return _access(name, operands, memory)
    return _ordinary(name, operands)


def _access(name: str, operands: tuple[str, ...], at: int) -> Effect:
    """Return the effect of a load or store of one or two registers, with or without address write-back."""
    moved = operands[:at]
    pair = len(moved) == 2
    wide = any(one[:1] in "qv{" for one in moved)
    memory = _memory(name, operands, at)
    bumps = memory.registers[:1] if operands[at].endswith("!") or at + 1 < len(operands) else ()
    slots = (2.0 if bumps else 1.0) + (1.0 if pair and wide else 0.0)
    registers = _registers(moved)
    if name.startswith("st"):
        return Effect(slots=slots, store="store", memory=memory, reads=registers, bumps=bumps)
    vector = bool(moved) and moved[0][:1] in "bhsdqv{"
    return Effect(
        slots=slots,
        load="load_vector" if vector else "load",
        loads=2 if pair and wide else 1,
        memory=memory,
        writes=registers,
        bumps=bumps,
    )


def _memory(name: str, operands: tuple[str, ...], at: int) -> MemoryOperand:
    where = operands[at]
    narrow = _NARROW.match(name)
    each = _WIDTHS[narrow[1]] if narrow else _WIDTHS.get(operands[0][:1], 8)
    after = at + 1 < len(operands)
    match = _DISPLACEMENT.search(where)
    place = "" if where.endswith("!") or after else _DISPLACEMENT.sub("", where)
    return MemoryOperand(_registers((where,)), place, int(match[1]) if match else 0, each * at)


def _ordinary(name: str, operands: tuple[str, ...]) -> Effect:
    reads = _registers(operands[1:])
    writes = _registers(operands[:1])
    if name in _COMPARES:
        reads, writes = _registers(operands), (FLAGS,)
    elif name in _SETS_FLAGS_TOO:
        writes = (*writes, FLAGS)
    if _READS_TARGET.match(name) or (name == "mov" and "[" in operands[0]):
        reads = (*reads, *_registers(operands[:1]))
    if _READS_FLAGS.match(name):
        reads = (*reads, FLAGS)
    operation, times = _operation(name, operands)
    return Effect(operation=operation, times=times, reads=reads, writes=writes)


def _operation(name: str, operands: tuple[str, ...]) -> tuple[str, int]:
    """Return the class of the operation and their number: a packed quotient has as many as parts."""
    first = operands[0] if operands else ""
    integer = [operand[:1] in "wx" for operand in operands if _REGISTER.fullmatch(operand) or "." in operand]
    if any(integer) and not all(integer):
        return "transfer", 1
    if all(integer):
        return _integer_class(name, operands), 1
    kind = next((kind for pattern, kind in _VECTOR if pattern.match(name)), "vector")
    if kind == "quotient":
        bits = "32" if first[:1] in "sh" or first.endswith("s") else "64"
        packed = {"2d": 2, "4s": 4, "2s": 2}.get(first.partition(".")[2], 1)
        return ("fp_divide" if name == "fdiv" else "fp_root") + bits, packed
    if name in ("mov", "fmov") and "#" not in operands[-1] and "[" not in "".join(operands):
        return "vector_move", 1
    return kind, 1


def _integer_class(name: str, operands: tuple[str, ...]) -> str:
    kind = next((kind for pattern, kind in _INTEGER if pattern.match(name)), "")
    if kind == "divide":
        return "divide64" if operands[0][:1] == "x" else "divide32"
    if kind:
        return kind
    if name == "mov":
        return "move" if _REGISTER.fullmatch(operands[-1]) else "alu"
    if not operands:  # clrex
        return "alu"
    shifted = _SHIFTED.match(operands[-1]) if name not in ("movz", "movk", "movn") else None
    if shifted is None:
        return "alu"
    quick = operands[-1].startswith("lsl") and int(shifted[1] or 0) <= 4 and name in ("add", "sub")
    return "alu" if quick else "shifted_alu"


def _registers(operands: tuple[str, ...]) -> tuple[str, ...]:
    found = []
    for operand in operands:
        for register in _REGISTER.finditer(operand):
            if register[5]:
                found.append("sp")
            elif register[1] and register[2] != "zr":
                found.append(f"x{register[2]}")
            elif register[3]:
                found.append(f"v{register[4]}")
    return tuple(found)
