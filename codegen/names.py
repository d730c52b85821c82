"""Decide which names may become C identifiers; nothing else of a user's text reaches the C as code."""

from __future__ import annotations

import re

from firmloop.codegen.bundle import CodegenError

LONGEST = 31  # significant initial characters of an external identifier, C99 5.2.4.1

# Keywords of C and C++, object-like macros of their headers and compilers, and what the generated functions occupy.
RESERVED = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while asm
    alignas alignof and and_eq atomic bitand bitor bool catch class compl concept consteval constexpr constinit
    const_cast co_await co_return co_yield decltype delete dynamic_cast explicit export false friend mutable namespace
    new noexcept not not_eq nullptr operator or or_eq private protected public reinterpret_cast requires static_assert
    static_cast template this thread_local throw true try typeid typename typeof typeof_unqual using virtual wchar_t xor
    xor_eq char8_t char16_t char32_t
    int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t intptr_t uintptr_t intmax_t uintmax_t
    complex imaginary noreturn stdin stdout stderr signgam math_errhandling
    self in out init step main errno assert near far interrupt linux unix i386
    """.split()
)

# What a project's name becomes at file scope; the setters are named by the parameters too.
ENDS = ("_t", "_in_t", "_out_t", "_init", "_step", "_assert_layout")

# Types and functions with such ends of the headers of C99 to C23, and what files and processes bring beside them in a
# program of POSIX, as the test on the host is. Other types of POSIX (timer_t, speed_t) are for who asks for them.
STANDARD = frozenset(
    """
    char8_t char16_t char32_t clock_t cnd_t cnd_init constraint_handler_t div_t double_t errno_t femode_t fenv_t
    fexcept_t float_t fpos_t imaxdiv_t intmax_t intptr_t ldiv_t lldiv_t max_align_t mbstate_t mtx_t mtx_init nullptr_t
    ptrdiff_t rsize_t sig_atomic_t size_t thrd_t thrd_start_t time_t tss_t tss_dtor_t uintmax_t uintptr_t wchar_t
    wctrans_t wctype_t wint_t
    blkcnt_t blksize_t dev_t gid_t ino_t mode_t nlink_t off_t pid_t ssize_t uid_t useconds_t
    """.split()
)

# Headers of C99 to C23 and of POSIX, on which those of C and C++ stand, and Arduino's where a file system knows no
# capitals: a NAME.h on the path of a build comes before the system's.
HEADERS = frozenset(
    """
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg stdatomic
    stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype
    aio cpio dirent dlfcn endian fcntl features fmtmsg fnmatch ftw glob grp iconv langinfo libgen libintl monetary
    mqueue ndbm netdb nl_types poll pthread pwd regex sched search semaphore spawn strings stropts syslog tar
    termios trace ulimit unistd utime utmpx wordexp
    arduino
    """.split()
)

FILES = frozenset("host host_main trace fmi3".split())  # NAME.c of ours, beside which the project's own is put
DEVICES = re.compile(r"con|prn|aux|nul|(com|lpt)[0-9]")
INTEGERS = re.compile(r"u_?int[0-9]+_t|u?int(_fast|_least)?[0-9]+_t")


def check_identifier(name: str, what: str) -> str:
    """Return `name` if it may stand in C as it is.

    Raises
    ------
    CodegenError
        when it is not letters, digits and single underscores starting with a lower case letter, is longer than 31
        characters, or is taken by C, C++ or the generated code. `what` says what the name names: capitals may stand in
        that of a signal, behind an underscore, for units have them (current_A). Of a project's name files, types and
        functions are made, and none of them may be taken either.
    """
    capitals = "A-Z" if what == "signal" else ""
    if not re.fullmatch(rf"[a-z][a-z0-9]*(_[a-z0-9{capitals}]+)*", name, flags=re.ASCII):
        ends = "or a unit behind an underscore, such as 'current_A'" if capitals else "such as 'wheel_speed'"
        raise CodegenError(
            f"{what} {name!r} cannot be a C name: use lower case letters, digits and single underscores, "
            f"starting with a letter, {ends}"
        )
    if len(name) > LONGEST:
        raise CodegenError(f"{what} {name!r} has {len(name)} characters; C guarantees {LONGEST}: choose a shorter one")
    if name in RESERVED or name.startswith(("fl_", "uint", "int_")):
        raise CodegenError(f"{what} {name!r} is taken by C, C++ or the generated code: choose another name")
    taker = _taker(name) if what == "project name" else ""
    if taker:
        raise CodegenError(f"{what} {name!r} is taken by {taker}: choose another name, such as '{name[:26]}_loop'")
    return name


def made_of(name: str) -> tuple[str, ...]:
    """Return the types and functions that the C of a project of this name has, but for its setters."""
    return tuple(f"{name}{end}" for end in ENDS)


def _taker(name: str) -> str:
    """Say who has a name already of those that identifiers and files get from a project's."""
    for made in made_of(name):
        plain = made.removeprefix("atomic_")  # <stdatomic.h> has each type once more
        if plain in STANDARD or INTEGERS.fullmatch(plain):
            return f"{made} of the headers of C and its libraries"
    if name in HEADERS:
        return f"the header <{name}.h>, which the {name}.h of the generated code would hide"
    if name in FILES:
        return f"{name}.c, a file that the generated code is built with"
    if DEVICES.fullmatch(name):
        return f"a device of Windows, where no file can be called {name}.c"
    return ""
