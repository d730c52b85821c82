"""The folder that `generate` writes builds as it lies, in the build systems that firmware is made with."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import xml.etree.ElementTree
from collections.abc import Mapping
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.codegen.bundle import write_files
from firmloop.codegen.emit import emit
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import QuantizeError
from tests.firmloop.conftest import PROJECT

NAME = "tank_heater"
CC = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-ffp-contract=off"]
USER = f'#include "{NAME}.h"\nint main(void) {{ {NAME}_t c; {NAME}_init(&c); return 0; }}\n'
# What the tools below define, as far as the generated files call it.
ESP_IDF = """
cmake_minimum_required(VERSION 3.16)
project(app C)
set(ESP_PLATFORM 1)
macro(idf_component_register)
  cmake_parse_arguments(IDF "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
  set(COMPONENT_LIB __idf_component)
  add_library(${COMPONENT_LIB} STATIC ${IDF_SRCS})
  target_include_directories(${COMPONENT_LIB} PUBLIC ${IDF_INCLUDE_DIRS})
endmacro()
add_subdirectory(components/NAME)
add_executable(app main.c)
target_link_libraries(app PRIVATE __idf_component)
"""
ESP_IDF_SCRIPT = """
set(ESP_PLATFORM 1)
macro(idf_component_register)
  message(STATUS "registered ${ARGN}")
  return()
endmacro()
include(components/NAME/CMakeLists.txt)
"""
ZEPHYR = """
cmake_minimum_required(VERSION 3.20)
project(app C)
set(CONFIG_MACRO y)
add_library(zephyr_interface INTERFACE)
function(zephyr_include_directories)
  foreach(each ${ARGN})
    target_include_directories(zephyr_interface INTERFACE ${CMAKE_CURRENT_SOURCE_DIR}/${each})
  endforeach()
endfunction()
macro(zephyr_library_named name)
  set(ZEPHYR_CURRENT_LIBRARY ${name})
  add_library(${name} STATIC)
  target_link_libraries(${name} PUBLIC zephyr_interface)
endmacro()
function(zephyr_library_sources)
  target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(zephyr_library_compile_options)
  target_compile_options(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
add_subdirectory(modules/NAME/zephyr module)
add_executable(app main.c)
target_link_libraries(app PRIVATE NAME)
"""
ADDED = """
cmake_minimum_required(VERSION 3.14)
project(app C)
add_subdirectory(lib/NAME)
add_executable(app main.c)
target_link_libraries(app PRIVATE NAME::NAME)
"""
FOUND = """
cmake_minimum_required(VERSION 3.14)
project(app C)
find_package(NAME 1.0 REQUIRED)
add_executable(app main.c)
target_link_libraries(app PRIVATE NAME::NAME)
"""
ARM = """
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_C_FLAGS_INIT "-mcpu=cortex-m4 -mthumb")
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
"""


def need(*programs: str) -> pytest.MarkDecorator:
    missing = [program for program in programs if not _runs(program)]
    return pytest.mark.skipif(bool(missing), reason=f"{', '.join(missing)} is not installed, or does not start")


def _runs(program: str) -> bool:
    """Tell whether a program is there, and starts: rustup may stand for a cargo that is not."""
    if shutil.which(program) is None:
        return False
    if program not in ("cargo", "rustc"):
        return True
    return subprocess.run([program, "--version"], capture_output=True, check=False).returncode == 0


def ran(command: list[str], folder: Path, status: int = 0) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == status, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def delivery(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate once; DIR holds the folder to copy."""
    place = tmp_path_factory.mktemp("delivery")
    (place / "p.toml").write_text(PROJECT)
    assert main(["generate", str(place / "p.toml"), "--out", str(place / "out")]) == 0
    return place / "out"


def app(folder: Path, delivery: Path, below: str, listing: str) -> Path:
    """Write a user's project that holds the folder as it was generated."""
    shutil.copytree(delivery / NAME, folder / below / NAME)
    (folder / "main.c").write_text(USER)
    (folder / "CMakeLists.txt").write_text(listing.replace("NAME", NAME).replace("CONFIG_MACRO", "CONFIG_TANK_HEATER"))
    return folder


def test_the_manifest_names_files_that_are_there(delivery: Path) -> None:
    manifest = json.loads((delivery / "manifest.json").read_text())
    assert manifest["sources"] == [f"{NAME}/src/{NAME}.c"] and manifest["include_dirs"] == [f"{NAME}/src"]
    for name in (*manifest["sources"], *manifest["headers"], *manifest["include_dirs"]):
        assert (delivery / name).exists()


def test_the_only_main_stands_in_test(delivery: Path) -> None:
    with_main = [path for path in delivery.rglob("*.c") if "int main(" in path.read_text()]
    assert [path.parent.name for path in with_main] == ["test"]


@need("cmake", "ctest")
def test_cmake_tests_the_folder_by_itself(delivery: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(delivery / NAME, tmp_path / NAME)
    ran(["cmake", "-B", "build", "-DCMAKE_COMPILE_WARNING_AS_ERROR=ON"], folder)
    ran(["cmake", "--build", "build"], folder)
    assert "100% tests passed" in ran(["ctest", "--test-dir", "build"], folder)


@need("cmake")
@pytest.mark.parametrize(("below", "listing"), [("lib", ADDED), ("components", ESP_IDF), ("modules", ZEPHYR)])
def test_a_cmake_project_that_holds_the_folder_builds(below: str, listing: str, delivery: Path, tmp_path: Path) -> None:
    folder = app(tmp_path, delivery, below, listing)
    ran(["cmake", "-B", "build", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON"], folder)
    ran(["cmake", "--build", "build"], folder)
    ran([str(next((folder / "build").glob("app*")))], folder)
    commands = json.loads((folder / "build" / "compile_commands.json").read_text())
    ours = [each["command"] for each in commands if each["file"].endswith(f"{NAME}.c")]
    assert len(ours) == 1 and "-ffp-contract=off" in ours[0]
    assert not [each for each in commands if each["file"].endswith("_test.c")]


@need("cmake")
def test_esp_idf_can_read_the_component_as_a_script(delivery: Path, tmp_path: Path) -> None:
    app(tmp_path, delivery, "components", "")
    (tmp_path / "requirements.cmake").write_text(ESP_IDF_SCRIPT.replace("NAME", NAME))
    assert f"registered SRCS;src/{NAME}.c" in ran(["cmake", "-P", "requirements.cmake"], tmp_path)


@need("cmake")
def test_an_installed_library_is_found(delivery: Path, tmp_path: Path) -> None:
    library = shutil.copytree(delivery / NAME, tmp_path / "library")
    ran(["cmake", "-B", "build", f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'prefix'}"], library)
    ran(["cmake", "--build", "build"], library)
    ran(["cmake", "--install", "build"], library)
    shutil.rmtree(library)
    user = app(tmp_path / "user", delivery, "unused", FOUND)
    ran(["cmake", "-B", "build", f"-DCMAKE_PREFIX_PATH={tmp_path / 'prefix'}"], user)
    ran(["cmake", "--build", "build"], user)
    ran([str(user / "build" / "app")], user)


@pytest.mark.cross
@need("cmake", "arm-none-eabi-gcc")
def test_cross_compiling_builds_the_library_and_no_test(delivery: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(delivery / NAME, tmp_path / NAME)
    (folder / "arm.cmake").write_text(ARM)
    ran(["cmake", "-B", "build", "-DCMAKE_TOOLCHAIN_FILE=arm.cmake"], folder)
    ran(["cmake", "--build", "build"], folder)
    assert (folder / "build" / f"lib{NAME}.a").is_file() and not list(folder.glob("build/*_test*"))


@need("make", "ar")
def test_make_builds_and_checks(delivery: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(delivery / NAME, tmp_path / NAME)
    assert "steps agree" in ran(["make", "check"], folder)


COMPILERS = [
    *[("gcc", f"-std={year}") for year in ("c99", "c11", "c17", "c2x")],
    *[("clang", f"-std={year}") for year in ("c99", "c17")],
]


@pytest.mark.parametrize(("compiler", "standard"), COMPILERS)
def test_all_c_files_of_src_build_together(compiler: str, standard: str, delivery: Path, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    (tmp_path / "main.c").write_text(USER)
    source = delivery / NAME / "src"
    files = [str(path) for path in source.glob("*.c")]
    ran([compiler, standard, *CC, f"-I{source}", "main.c", *files, "-o", "app"], tmp_path)


@need("g++", "gcc")
@pytest.mark.parametrize("standard", ["c++98", "c++11", "c++17", "c++20", "c++23"])
def test_cpp_takes_the_header(standard: str, delivery: Path, tmp_path: Path) -> None:
    source = delivery / NAME / "src"
    (tmp_path / "main.cpp").write_text(USER.replace("(void)", "()"))
    ran(["gcc", "-std=c99", *CC, f"-I{source}", "-c", str(source / f"{NAME}.c"), "-o", "c.o"], tmp_path)
    ran(["g++", f"-std={standard}", *CC[:-1], f"-I{source}", "main.cpp", "c.o", "-o", "app"], tmp_path)


RUST = """
use NAME::{Controller, Inputs};
fn main() {
    let mut controller = Controller::new();
    for k in 0..200 {
        let inputs = Inputs { reference: k as f32 * 0.3, measurement: (k % 7) as f32 };
        let (outputs, status) = controller.step(&inputs);
        println!("{:08x} {}", outputs.output.to_bits(), status);
    }
}
"""
SAME_IN_C = """
#include <stdio.h>
#include <string.h>
#include "NAME.h"
int main(void) {
    NAME_t controller; NAME_in_t in; NAME_out_t out; unsigned bits; int k;
    NAME_init(&controller);
    for (k = 0; k < 200; ++k) {
        in.reference = (float)k * 0.3f; in.measurement = (float)(k % 7);
        const unsigned status = NAME_step(&controller, &in, &out);
        memcpy(&bits, &out.output, sizeof bits);
        printf("%08x %u\\n", bits, status);
    }
    return 0;
}
"""


@need("cargo", "rustc", "gcc", "ar")
def test_a_rust_program_that_depends_on_the_folder_gets_the_same_bits(delivery: Path, tmp_path: Path) -> None:
    shutil.copytree(delivery / NAME, tmp_path / NAME)
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "main.rs").write_text(RUST.replace("NAME", NAME))
    (tmp_path / "Cargo.toml").write_text(
        '[package]\nname = "user"\nversion = "0.1.0"\nedition = "2021"\n[dependencies]\n'
        f'{NAME} = {{ path = "{NAME}" }}\n'
    )
    said = ran(["cargo", "build", "--offline", "--quiet"], tmp_path)
    assert "warning" not in said
    (tmp_path / "same.c").write_text(SAME_IN_C.replace("NAME", NAME))
    source = tmp_path / NAME / "src"
    ran(["gcc", "-std=c99", f"-I{source}", "same.c", str(source / f"{NAME}.c"), "-o", "same"], tmp_path)
    lines = ran([str(tmp_path / "target" / "debug" / "user")], tmp_path).splitlines()
    assert len(set(lines)) > 40 and lines == ran([str(tmp_path / "same")], tmp_path).splitlines()


CORES = {
    "avr-gcc": ["-mmcu=atmega2560"],
    "arm-none-eabi-gcc": ["-mcpu=cortex-m0plus", "-mthumb", "--specs=nosys.specs", "-Wl,--no-warnings"],
}


@pytest.mark.parametrize("compiler", CORES)
def test_the_compilers_of_arduino_boards_link_the_library(compiler: str, delivery: Path, tmp_path: Path) -> None:
    """As their build does it: all C below src/, gnu11, for size."""
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    (tmp_path / "sketch.c").write_text(USER)
    source = delivery / NAME / "src"
    files = [str(path) for path in source.rglob("*.c")]
    flags = [*CORES[compiler], "-std=gnu11", "-Os", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    ran([compiler, *flags, f"-I{source}", "sketch.c", *files, "-o", "sketch.elf"], tmp_path)


EVERYTHING = [
    "-Weverything",
    "-Wno-padded",  # what a structure loses to alignment is the user's to weigh
    "-Wno-declaration-after-statement",  # which C99 has
    "-Wno-float-equal",  # a NaN is what is not equal to itself, and limits are met exactly
]


@need("clang")
@pytest.mark.parametrize("arithmetic", ["float32", "fixed16"])
@pytest.mark.parametrize("kind", kinds())
def test_clang_finds_nothing_in_any_kind(kind: str, arithmetic: str, tmp_path: Path) -> None:
    try:
        program = lower(kinds()[kind].design(kinds()[kind].example).law, arithmetic)
    except QuantizeError as error:
        pytest.skip(str(error))
    bundle = emit(program, "firmloop generate p.toml")
    write_files(bundle.files, tmp_path)
    command = ["clang", "-std=c99", "-Werror", *EVERYTHING, "-ffp-contract=off", "-O1", "-c", *bundle.sources]
    ran(command, tmp_path)


def properties(text: str) -> Mapping[str, str]:
    return dict(line.partition("=")[::2] for line in text.splitlines())


@need("gcc")
def test_an_arduino_build_of_the_library_links(delivery: Path, tmp_path: Path) -> None:
    """What the specification says: all C below src/ and only that, with src/ as include path."""
    library = delivery / NAME
    said = properties((library / "library.properties").read_text())
    wanted = ("name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url", "architectures")
    assert all(key in said for key in wanted) and said["name"] == NAME and said["architectures"] == "*"
    (tmp_path / "sketch.c").write_text(f"#include <{said['includes']}>\n{USER}")
    sources = [str(path) for path in (library / "src").rglob("*.c")]
    ran(["gcc", f"-I{library / 'src'}", "sketch.c", *sources, "-o", "sketch"], tmp_path)


def test_manifests_of_package_managers_name_what_is_there(delivery: Path) -> None:
    folder = delivery / NAME
    platformio = json.loads((folder / "library.json").read_text())
    assert platformio["name"] == NAME and platformio["build"]["flags"] == ["-ffp-contract=off"]
    assert (folder / platformio["build"]["srcDir"] / platformio["headers"][0]).is_file()
    assert (folder / "idf_component.yml").read_text().startswith('version: "1.0.0"\n')
    module = (folder / "zephyr" / "module.yml").read_text()
    assert f"name: {NAME}\n" in module and "cmake: zephyr\n" in module and "kconfig: zephyr/Kconfig\n" in module
    assert (folder / "zephyr" / "Kconfig").read_text().startswith("config TANK_HEATER\n\tbool ")
    pack = xml.etree.ElementTree.parse(folder / f"firmloop.{NAME}.pdsc").getroot()
    assert f"{pack.findtext('vendor')}.{pack.findtext('name')}" == f"firmloop.{NAME}"
    listed = {each.attrib["name"] for each in pack.iter("file")}
    assert listed == {"src/", *(f"src/{path.name}" for path in (folder / "src").iterdir())}


def test_the_bill_of_materials_holds_every_file_with_its_checksum(delivery: Path) -> None:
    folder = delivery / NAME
    bill = json.loads((folder / f"{NAME}.spdx.json").read_text())
    assert bill["spdxVersion"] == "SPDX-2.3"
    sums = {each["fileName"]: each["checksums"] for each in bill["files"]}
    assert set(sums) == {f"./src/{path.name}" for path in (folder / "src").iterdir()}
    for name, checksums in sums.items():
        for each in checksums:
            digest = hashlib.new(each["algorithm"].lower(), (folder / name).read_bytes()).hexdigest()
            assert digest == each["checksumValue"]
    assert set(bill["packages"][0]["hasFiles"]) == {each["SPDXID"] for each in bill["files"]}
