"""Instructions whose time is taken, for each class of operations: dependent ones and independent ones.

A snippet is assembly for GCC's and clang's ``asm``. ``chain`` is a link of a dependent chain, of ``links``
operations; what it has beside them is named in ``less`` and taken off again. ``free`` is an independent one,
with ``{0}`` for the number of one of eight registers.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Snippet:
    """One class: see the module."""

    chain: str
    free: str
    links: int = 1
    less: tuple[str, ...] = ()


X86_64 = {
    "alu": Snippet("add %%rbx, %%rax", "add %%rbx, %%r{0}"),
    "increment": Snippet("add $1, %%rax", "add $1, %%r{0}"),
    "move": Snippet("mov %%rax, %%rcx; mov %%rcx, %%rax", "mov %%rbx, %%r{0}", links=2),
    "shift": Snippet("shl $3, %%rax", "shl $3, %%r{0}"),
    "shifted_alu": Snippet("lea 1(%%rax,%%rax,4), %%rax", "lea 1(%%rbx,%%rbx,4), %%r{0}"),
    "multiply": Snippet("imul %%rax, %%rax", "imul %%rbx, %%r{0}"),
    "divide32": Snippet("xor %%edx, %%edx; div %%ebx", "mov %%r{0}d, %%eax; xor %%edx, %%edx; div %%ebx"),
    "divide64": Snippet("xor %%edx, %%edx; div %%rbx", "mov %%r{0}, %%rax; xor %%edx, %%edx; div %%rbx"),
    "load": Snippet("mov 16(%%rsi,%%rcx), %%rcx", "mov 16+8*{0}(%%rsi), %%r{0}"),
    "transfer": Snippet("movq %%xmm0, %%rcx; movq %%rcx, %%xmm0", "movq %%rbx, %%xmm{0}", links=2),
    "load_vector": Snippet(
        "movsd 16(%%rsi,%%rcx), %%xmm0; movq %%xmm0, %%rcx",
        "movsd 16+8*{0}(%%rsi), %%xmm{0}",
        less=("transfer",),
    ),
    "store": Snippet("mov %%rbx, 256(%%rsi)", "mov %%rbx, 256+8*{0}(%%rsi)"),
    "branch": Snippet("jo 1f; 1:", "jo 1f; 1:"),
    "vector": Snippet("paddd %%xmm2, %%xmm3", "paddd %%xmm2, %%xmm{0}"),
    "vector_move": Snippet(
        "movaps %%xmm0, %%xmm4; movaps %%xmm4, %%xmm0", "movaps %%xmm0, %%xmm{0}", links=2
    ),
    "shuffle": Snippet("unpcklps %%xmm1, %%xmm0", "unpcklpd %%xmm0, %%xmm{0}"),
    "vector_multiply": Snippet("pmuludq %%xmm2, %%xmm3", "pmuludq %%xmm2, %%xmm{0}"),
    "fp_add": Snippet(
        "andpd %%xmm0, %%xmm0; addsd %%xmm1, %%xmm0", "addsd %%xmm0, %%xmm{0}", less=("vector",)
    ),
    "fp_multiply": Snippet("mulsd %%xmm1, %%xmm0", "mulsd %%xmm0, %%xmm{0}"),
    "fp_compare": Snippet("maxsd %%xmm1, %%xmm0", "maxsd %%xmm0, %%xmm{0}"),
    "fp_divide32": Snippet("divss %%xmm1, %%xmm0", "divss %%xmm0, %%xmm{0}"),
    "fp_divide64": Snippet("divsd %%xmm1, %%xmm0", "divsd %%xmm0, %%xmm{0}"),
    "fp_root32": Snippet("sqrtss %%xmm0, %%xmm0", "sqrtss %%xmm0, %%xmm{0}"),
    "fp_root64": Snippet("sqrtsd %%xmm0, %%xmm0", "sqrtsd %%xmm0, %%xmm{0}"),
    "convert": Snippet(
        "cvtps2pd %%xmm0, %%xmm0; cvtpd2ps %%xmm0, %%xmm0", "cvttsd2si %%xmm{0}, %%rax", links=2
    ),
}
"""``rbx`` holds 3, ``rsi`` points to two numbers and zeros, ``rcx`` is 0, ``xmm1`` is a little above 1."""

SNIPPETS = {"x86_64": X86_64}

FORWARD = {"x86_64": "addsd %%xmm1, %%xmm0; movsd %%xmm0, 256(%%rsi); movsd 256(%%rsi), %%xmm0"}
"""A sum that goes through memory: what is more than the sum is the way from a store to a load."""

NOTHING = {"x86_64": "nop"}

_CHANGED = ("rax", "rbx", "rcx", "rdx", *(f"r{n}" for n in range(8, 16)), *(f"xmm{n}" for n in range(16)))
PROLOGUE = {
    "x86_64": (
        "mov $3, %%ebx; mov $1, %%eax; mov $1, %%edx; movsd 8(%%rsi), %%xmm0; movsd (%%rsi), %%xmm1;"
        "xor %%ecx, %%ecx; movd %%ebx, %%xmm2; movd %%ebx, %%xmm3; .balign 64; 2:",
        "dec %%rdi; jnz 2b",
        ('"+S"', '"+D"'),
        ", ".join(f'"{name}"' for name in (*_CHANGED, "cc", "memory")),
    )
}
"""What stands before a loop and at its end, where the pointer and the passes are, and what it changes."""

IF_ODD = {
    "x86_64": '__asm__ volatile("test $1, %b1; je 1f; add $1, %0; 1:" : "+r"(taken) : "r"(bits) : "cc")',
}
"""A branch by the lowest bit of a number that is there at once."""
