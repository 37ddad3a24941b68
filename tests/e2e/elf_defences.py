"""Finds the hardening of a program in its file, using only readelf and objdump."""
import re
import subprocess

# The defences that are looked for, and the condition for each.
ALL = {
    "pie": "is loaded anywhere (ET_DYN with the flag PIE)",
    "relro": "has memory that is made read-only after loading (GNU_RELRO)",
    "bind_now": "resolves all symbols when it is loaded (BIND_NOW), so that all of that memory is read-only",
    "stack_not_executable": "has a GNU_STACK that is not executable",
    "nothing_writable_executable": "has no segment that is both writable and executable",
    "no_text_relocations": "has no TEXTREL",
    "no_rpath": "has neither RPATH nor RUNPATH",
    "stack_protector": "calls __stack_chk_fail",
    "fortify": "calls glibc's checking functions (__…_chk)",
    "library_assertions": "calls std::__glibcxx_assert_fail",
    "stack_clash": "touches each page of a large frame (or $0,(%rsp) after sub $0x1000,%rsp)",
    "branch_targets": "begins functions with endbr64",
    "shadow_stack": "says SHSTK in its notes",
}


def _said(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def search_path(path):
    """Returns: the entries of RPATH or RUNPATH in the ELF file `path`, unexpanded. An empty entry means the working directory."""
    return [folder for entries in re.findall(r"\((?:RPATH|RUNPATH)\)\s+Library r(?:un)?path: \[(.*)\]", _said("readelf", "-dW", path)) for folder in entries.split(":")]


def defences(path):
    """Returns the names of those in ALL that `path` has."""
    headers, dynamic = _said("readelf", "-hlW", path), _said("readelf", "-dW", path)
    symbols, notes = _said("readelf", "--dyn-syms", "-W", path), _said("readelf", "-nW", path)
    code = _said("objdump", "-d", "--no-show-raw-insn", path)
    # The columns of a program header: type, offset, two addresses, two sizes, flags, alignment.
    segments = re.findall(r"^\s+(\w+)\s+0x[0-9a-f]+ 0x[0-9a-f]+ 0x[0-9a-f]+ 0x[0-9a-f]+ 0x[0-9a-f]+ ([RWE ]{3}) 0x", headers, re.M)
    flags = " ".join(re.findall(r"\((?:FLAGS|FLAGS_1)\)\s+(?:Flags: )?(.*)$", dynamic, re.M)).split()
    imported = re.findall(r"\sUND\s+(\w+)", symbols)
    stack = [one for kind, one in segments if kind == "GNU_STACK"]
    found = {
        "pie": "Type:                              DYN" in headers and "PIE" in flags,
        "relro": any(kind == "GNU_RELRO" for kind, _ in segments),
        "bind_now": "BIND_NOW" in flags or "NOW" in flags or "(BIND_NOW)" in dynamic,
        "stack_not_executable": stack != [] and "E" not in stack[0],
        "nothing_writable_executable": not any("W" in one and "E" in one for _, one in segments),
        "no_text_relocations": "(TEXTREL)" not in dynamic and "TEXTREL" not in flags,
        "no_rpath": "(RPATH)" not in dynamic and "(RUNPATH)" not in dynamic,
        "stack_protector": "__stack_chk_fail" in imported,
        "fortify": any(re.fullmatch(r"__\w+_chk", name) for name in imported),
        "library_assertions": any("__glibcxx_assert_fail" in name for name in imported),
        # The probe may be anywhere in the new page: GCC may touch its far end.
        "stack_clash": re.search(
            r"sub\s+\$0x1000,%rsp\n.*or[ql]?\s+\$0x0,(?:0x[0-9a-f]+)?\(%rsp\)", code
        )
        is not None,
        "branch_targets": "endbr64" in code,
        "shadow_stack": "SHSTK" in notes,
    }
    assert found.keys() == ALL.keys()
    return {name for name, there in found.items() if there}
