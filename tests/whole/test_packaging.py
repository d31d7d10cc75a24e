"""The contents of the installed package match the folder from which it is built."""

from __future__ import annotations

import configparser
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from test_architecture import FILES, imports  # parsed once for both

import vtk_segdeform
from vtk_segdeform.cli import application

ROOT = Path(__file__).resolve().parents[2]
LIBRARY_OF = {
    "vtkmodules": "vtk",
    "igl": "libigl",
    "PIL": "pillow",
    "IPython": "ipython",
    "trame_client": "trame-client",
    "trame_server": "trame-server",
}  # imported name -> name to install
# ParaView loads our plugin itself; Blender's module has wheels for a single version of Python.
UNDECLARED = {"paraview", "bpy"}


@pytest.fixture(scope="module")
def setup_cfg():
    parser = configparser.ConfigParser()
    parser.read(ROOT / "setup.cfg", encoding="utf-8")
    return parser


def names_in(text: str) -> set[str]:
    """Return the packages of a requirement list, without their versions."""
    return {re.split(r"[^\w.-]", line.strip())[0] for line in text.splitlines() if line.strip()}


def imported() -> set[str]:
    """Return the top-level names that the sources import from elsewhere."""
    found = {what.module for name in FILES for what in imports(name) if not what.ours}
    return found - set(sys.stdlib_module_names) - {"vtk_segdeform"}


def test_every_library_imported_is_declared(setup_cfg):
    declared = names_in(setup_cfg["options"]["install_requires"])
    for extra in ("meshlab", "qt", "web", "jupyter", "bench", "dask", "remote"):
        declared |= names_in(setup_cfg["options.extras_require"][extra])
    used = imported()
    assert {"numba", "qtpy"} <= used  # the sources of all folders are read
    assert {LIBRARY_OF.get(name, name) for name in used - UNDECLARED} <= declared


@pytest.mark.campaign
@pytest.mark.parametrize("versions", ["lowest", "newest"])
def test_the_suite_passes_with_the_lowest_and_with_the_newest_versions(versions):
    subprocess.run(["make", f"test-{versions}", f"VENV={sys.prefix}"], cwd=ROOT, check=True)


# The newest Pythons have no wheels of the lowest versions.
@pytest.mark.skipif(
    "SEGDEFORM_LOWEST" not in os.environ or sys.version_info >= (3, 13), reason="make test-lowest"
)
def test_the_lowest_versions_are_those_that_are_tested(setup_cfg):
    lists = [setup_cfg["options"]["install_requires"]]
    lists += [setup_cfg["options.extras_require"][extra] for extra in ("meshlab", "app", "web")]
    lines = [
        line.partition("#")[0].partition(";")[0] for each in lists for line in each.splitlines()
    ]
    lowest = dict(re.findall(r"([\w-]+)>=([\w.]+)", "\n".join(lines)))
    assert len(lowest) > 15
    tested = {name: metadata.version(name) for name in lowest}
    short = {name: re.sub(r"(\.0)+$", "", version) for name, version in tested.items()}
    assert short == {name: re.sub(r"(\.0)+$", "", version) for name, version in lowest.items()}


def test_every_folder_with_code_is_a_declared_package(setup_cfg):
    declared = set(setup_cfg["options"]["packages"].split())
    core = {path.relative_to(ROOT) for path in (ROOT / "vtk_segdeform").rglob("__init__.py")}
    widgets = {path.relative_to(ROOT) for path in (ROOT / "widgets").rglob("__init__.py")}
    there = core | {Path("vtk_segdeform", path) for path in widgets}
    assert declared == {".".join(path.parent.parts) for path in there}


def test_importing_the_package_is_silent_and_loads_no_toolkit():
    code = (
        "import sys, vtk_segdeform; "
        "print(sorted({'PySide6', 'pymeshlab', 'matplotlib', 'numba'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=ROOT, capture_output=True, text=True
    )
    assert (done.stdout.strip(), done.stderr) == ("[]", "")


def copied(source: str, target: str) -> None:
    """Copy a file; of most modules only the name, which is all that is checked."""
    if source.endswith(".py") and not source.endswith(("__init__.py", "version.py")):
        Path(target).touch()
    else:
        shutil.copy(source, target)


def test_the_wheel_contains_both_packages_and_the_licence(tmp_path):
    pytest.importorskip("setuptools", minversion="77", reason="an older one needs wheel")
    source = tmp_path / "source"
    source.mkdir()
    for folder in ("vtk_segdeform", "widgets"):
        shutil.copytree(
            ROOT / folder,
            source / folder,
            ignore=shutil.ignore_patterns("__pycache__"),
            copy_function=copied,
        )
    for name in ("setup.cfg", "pyproject.toml", "LICENSE"):
        shutil.copy(ROOT / name, source)
    (source / "README.md").write_text("readme\n")
    build = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", build, str(tmp_path)], cwd=source, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    inside = set(zipfile.ZipFile(wheel).namelist())
    for folder, place in (("vtk_segdeform", "vtk_segdeform"), ("widgets", "vtk_segdeform/widgets")):
        ours = {path.relative_to(ROOT / folder) for path in (ROOT / folder).rglob("*.py")}
        assert {f"{place}/{path.as_posix()}" for path in ours} <= inside
    assert "vtk_segdeform/py.typed" in inside
    assert any(name.endswith("LICENSE") for name in inside)
    assert not any(name.startswith(("tests/", "widgets/", "examples/")) for name in inside)
    assert vtk_segdeform.__version__ in wheel.name


def test_the_sdist_contains_what_builds_the_package_and_no_pictures(tmp_path):
    pytest.importorskip("setuptools", minversion="77", reason="an older one needs wheel")
    source = tmp_path / "source"
    git = shutil.which("git")
    listed = subprocess.run([git, "ls-files", "-z"], cwd=ROOT, capture_output=True) if git else None
    if listed is None or listed.returncode:
        pytest.skip("no repository")
    for name in filter(None, listed.stdout.decode().split("\0")):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        copied(str(ROOT / name), str(source / name))
    build = "import sys; from setuptools import build_meta; build_meta.build_sdist(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", build, str(tmp_path)], cwd=source, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (sdist,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
        about = archive.extractfile(
            next(each for each in archive if each.name.endswith("/PKG-INFO"))
        )
        assert_it_can_be_shown_anywhere(about.read().decode())
    ours = {
        each
        for each in listed.stdout.decode().split("\0")
        if each.startswith(("vtk_seg", "widgets/"))
    }
    assert ours <= inside
    assert {"setup.cfg", "pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md"} <= inside
    assert [name for name in inside if re.search(r"\.(png|gif|jpe?g)$|^(docs|tests)/", name)] == []


def assert_it_can_be_shown_anywhere(about: str) -> None:
    """Check the description for a package index, where only whole addresses lead anywhere."""
    fields, _, text = about.partition("\n\n")
    (author,) = re.findall(r"- name: (.+)", (ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert f"\nAuthor: {author}\n" in fields
    assert re.findall(r"\]\((?!https://)", text) == []
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    paragraph = text.strip().partition("\n\n")[0]
    assert paragraph in readme
    (code,) = re.findall(r"```python\n.*?```", text, re.DOTALL)
    assert code in readme


def test_the_conda_recipe_builds_this_version_with_the_same_requirements(setup_cfg):
    recipe = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    assert re.findall(r'version: "(.+)"', recipe) == [vtk_segdeform.__version__]
    assert re.search(r"\n  url: https://.+\.tar\.gz\n  sha256: ", recipe)  # of a release
    listed = re.findall(r"(?m)^    - (\S+) (>=\S+)$", recipe.partition("\n  run:\n")[2])
    required = (
        setup_cfg["options"]["install_requires"]
        + "\npython"
        + setup_cfg["options"]["python_requires"]
    )
    lowest = dict(re.findall(r"(?m)^([\w-]+)(>=[\d.]+)", required))
    assert dict(listed) == lowest


PACKAGE = r"lib[a-z0-9.+-]*[0-9]"


def packages_for_the_desktop() -> set[str]:
    """Return the Debian packages that .ci/run installs for the desktop program."""
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    return set(re.search(r"desktop=\((.*?)\)", script, re.S)[1].split())


@pytest.mark.parametrize("page", ["README.md", "docs/tutorial/desktop.rst"])
def test_the_packages_for_the_desktop_are_the_same_everywhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    line = re.search(rf"apt-get install (libdbus-1-3(?:[\s\\]+{PACKAGE})+)", text)[1]
    assert set(re.findall(PACKAGE, line)) == packages_for_the_desktop()


@pytest.mark.skipif(not shutil.which("dpkg-query"), reason="no Debian")
def test_the_packages_for_the_desktop_contain_every_library_of_qt():
    plugins = application._platform_plugins()
    if not plugins:
        pytest.skip("no Qt with its own plugins")
    query = ["dpkg-query", "-W", "-f=${Package}:${Depends}, ${Pre-Depends}\n"]
    lines = subprocess.run(query, capture_output=True, text=True, check=True).stdout.splitlines()
    depends = {
        name: {re.split(r"[ :|(]", each.strip())[0] for each in rest.split(",")}
        for name, _, rest in (line.partition(":") for line in lines)
    }
    installed, new = set(), packages_for_the_desktop()
    while new:
        installed |= new
        new = set().union(*(depends.get(name, set()) for name in new)) - installed
    ldd = subprocess.run(["ldd", *plugins], capture_output=True, text=True, check=True).stdout
    libraries = set(re.findall(r"(?m)^\s*(lib\S+) => /(?:usr/)?lib", ldd))
    assert len(libraries) > 20
    query = ["dpkg-query", "-L", *(installed & depends.keys())]
    files = subprocess.run(query, capture_output=True, text=True, check=False).stdout
    assert libraries - {path.rpartition("/")[2] for path in files.splitlines()} == set()


def test_the_newest_release_of_the_changelog_is_this_version():
    headings = re.findall(r"(?m)^## (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    releases = [heading for heading in headings if heading != "Unreleased"]
    assert re.fullmatch(rf"{re.escape(vtk_segdeform.__version__)} - \d{{4}}-\d\d-\d\d", releases[0])


def test_no_file_contains_a_private_path():
    private = re.compile(r"/work/|/root/|/home/\w+/")
    for folder in ("vtk_segdeform", "widgets", "examples", "tests"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if path != Path(__file__):
                assert not private.search(path.read_text()), path
