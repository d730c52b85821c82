"""The floors of the house: which package may import which, and inside each the order of its rooms."""

from __future__ import annotations

# From the data's first stop to its last; a package may import from those on its left, and those listed for it.
FLOORS = ("identify", "design", "quantize", "codegen", "verify", "diagnose", "firmloop")
MAY_IMPORT = {
    "identify": (),
    "design": ("identify",),
    "quantize": ("identify", "design"),
    "codegen": ("quantize", "identify"),  # not design: C is printed from a Program, which knows no law
    "verify": ("identify", "design", "quantize", "codegen"),
    "diagnose": ("identify", "verify"),
    "firmloop": ("identify", "design", "quantize", "codegen", "verify", "diagnose"),
}
# Inside a package, low to high: what stands beside one another imports nothing of its own floor's other rooms.
ROOMS: dict[str, tuple[tuple[str, ...], ...]] = {
    "identify": (
        ("error", "extras", "normal", "regular_file", "signal", "unit_marks"),
        ("printed_units",),
        ("units",),
        ("plants",),
        ("recordings",),
        ("simulation",),
        ("fitting",),
        ("bench_tests",),
    ),
    "design": (
        ("law", "outcome", "draft"),
        ("table", "roles", "optimum"),
        ("design", "safe_output"),
        ("tunable", "discretize", "quadratic"),
        ("linear",),
        ("models",),
        ("tuning",),
        ("kinds",),
        ("analysis",),
    ),
    "quantize": (
        ("shifts",),
        ("program",),
        ("twins", "not_a_number", "rows"),
        ("formats",),
        ("ops",),
        ("free_state",),
        ("lower", "proof"),
        ("word_length",),
    ),
    "verify": (
        ("lanes",),
        ("reference", "link", "judgement"),
        ("packing", "scaling", "block"),
        ("compare",),
        ("verdict",),
        ("stimuli", "links"),
        ("build",),
        ("proofs",),
        ("explain", "replay", "searches"),
        ("trial",),
        ("run",),
    ),
    "codegen": (
        ("bundle", "toolchain"),
        ("environment", "misra", "names", "toml_table", "view"),
        ("delivery", "emit", "host", "target"),
        ("firmware", "fmu", "packages"),
        ("plant_fmu",),
    ),
    "diagnose": (
        ("policy", "finding", "plant_words"),
        ("data",),
        ("model",),
        ("search",),
        ("discrepancy", "controller"),
        ("completion", "sentences"),
        ("given_values", "verdict", "withheld"),
        ("run",),
    ),
    "firmloop": (
        ("arithmetic", "console", "project", "version"),
        ("output", "stages"),
        ("presentation", "scope"),
        ("door",),
        ("told", "arguments"),
        ("commands",),
        ("cli",),
        ("__main__",),
    ),
}
