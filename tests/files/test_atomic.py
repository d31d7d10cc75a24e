"""A file is replaced as a whole or not at all, and only abandoned drafts are deleted."""

from __future__ import annotations

import os
import threading
import time

import pytest

from vtk_segdeform.files.atomic import is_draft, replacing, require_place

posix = pytest.mark.skipif(os.name != "posix", reason="modes, links and pipes of files")
DRAFT = ".segdeform-0123456789abcdef.part"


def write(path, text="new", **options):
    """Replace a file."""
    with replacing(path, **options) as draft:
        draft.write_text(text)


def break_off(path, fault, **options):
    """Start to replace a file, and raise *fault* half way."""
    with replacing(path, **options) as draft:
        draft.write_text("half")
        raise fault


def fill_the_disk(path):
    """Write a file to a full disk."""
    with replacing(path) as draft:
        draft.unlink()
        draft.symlink_to("/dev/full")
        draft.write_text("new")


def names(folder):
    """Return the names of all files in a folder."""
    return sorted(os.listdir(folder))


@pytest.mark.parametrize("fault", [OSError(28, "full"), ValueError("no"), KeyboardInterrupt()])
def test_after_any_error_only_the_old_file_is_left(tmp_path, fault):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(type(fault)):
        break_off(path, fault)
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is full")
def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path):
    with pytest.raises(OSError, match="No space left"):
        fill_the_disk(tmp_path / "a.txt")
    assert names(tmp_path) == []
    assert os.path.exists("/dev/full")


def test_the_new_file_is_flushed_before_it_replaces_the_old_one(tmp_path, monkeypatch):
    calls = []
    for name in ("fsync", "replace"):
        real = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *a, n=name, r=real: (calls.append(n), r(*a))[1])
    write(tmp_path / "a.txt")
    assert calls[:2] == ["fsync", "replace"]
    calls.clear()
    write(tmp_path / "a.txt", durable=False)
    assert calls == ["replace"]


@posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o755])
def test_the_mode_is_kept_and_drafts_are_private(tmp_path, mode):
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(mode)
    with replacing(path) as draft:
        draft.write_text("new")
        assert draft.stat().st_mode & 0o777 == 0o600
    assert path.stat().st_mode & 0o777 == mode
    before = os.umask(0o027)
    try:
        write(tmp_path / "fresh.txt")
    finally:
        os.umask(before)
    assert (tmp_path / "fresh.txt").stat().st_mode & 0o777 == 0o640


@posix
def test_links_are_kept_and_their_targets_replaced(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "a.txt").write_text("old")
    (tmp_path / "link").symlink_to("again")
    (tmp_path / "again").symlink_to("there/a.txt")
    write(tmp_path / "link")
    assert (tmp_path / "there" / "a.txt").read_text() == "new"
    assert (tmp_path / "link").is_symlink()
    (tmp_path / "dangling").symlink_to("there/b.txt")
    write(tmp_path / "dangling")  # as open() would
    assert names(tmp_path / "there") == ["a.txt", "b.txt"]
    write(tmp_path / "link", "mine", follow=False)
    assert not (tmp_path / "link").is_symlink()
    assert (tmp_path / "there" / "a.txt").read_text() == "new"


@posix
def test_anything_but_a_regular_file_is_refused_and_unchanged(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "to pipe").symlink_to("pipe")
    before = names(tmp_path)
    for name, says in [
        ("pipe", "a device or a pipe"), ("folder", "a folder"), ("circle", "a link"),
        ("to pipe", "a device or a pipe"), ("no/a", "there is no folder"), ("pipe/a", "directory"),
        ("a\0b", "null character"), ("n" * 256, "too long"), ("/dev/null", "a device"),
    ]:  # fmt: skip
        with pytest.raises(OSError, match=says):
            write(tmp_path / name)
        with pytest.raises(OSError, match=says):
            require_place(tmp_path / name)
    assert names(tmp_path) == before
    assert (tmp_path / "pipe").is_fifo()


@posix
@pytest.mark.skipif(not os.path.exists("/proc/self"), reason="needs a folder that is read-only")
def test_a_read_only_folder_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    with pytest.raises(OSError, match=f"{tmp_path} may not be written to"):
        require_place(tmp_path / "a.txt")
    monkeypatch.undo()
    with pytest.raises(OSError, match=r"proc|No such|Permission|not permitted"):
        write("/proc/self/a.txt")


@posix
@pytest.mark.parametrize(
    "name",
    [
        b"n" * 255,
        b"n" + b"." + b"s" * 253,
        b"\xff\xfe.ply",
        "Körper 身体.ply".encode(),
        b" ",
        b"-n",
    ],
)
def test_every_name_that_the_system_allows_can_be_written(tmp_path, name):
    path = tmp_path / os.fsdecode(name)
    for text in ("first", "second"):
        write(path, text)
        assert path.read_text() == text
    assert names(tmp_path) == [os.fsdecode(name)]


def test_a_draft_has_the_suffix_by_which_writers_know_the_format(tmp_path):
    with replacing(tmp_path / "a.vtp") as draft:
        assert draft.suffix == ".vtp"
        assert is_draft(draft.name)
        assert draft.parent == tmp_path


@posix
def test_only_our_own_drafts_are_deleted(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "precious").write_text("mine")
    for name in (
        ".segdeform-0123.part", ".segdeform-0123456789ABCDEF.part", "x.part", ".segdeform-",
        "segdeform-0123456789abcdef.part", f"{DRAFT}.bak.txt", ".0123456789abcdef.part",
    ):  # fmt: skip
        (tmp_path / name).write_text("mine")
    (tmp_path / DRAFT).symlink_to("mine")
    (tmp_path / DRAFT.replace("0", "1")).symlink_to("mine/precious")
    os.mkfifo(tmp_path / DRAFT.replace("0", "2"))
    film = tmp_path / DRAFT.replace("0", "3")
    film.mkdir()
    (film / "0000.png").write_text("?")
    swept = [tmp_path / DRAFT.replace("0", "4"), tmp_path / f"{DRAFT.replace('0', '5')}.vtp"]
    for draft in swept:
        draft.write_text("half")
    before = set(names(tmp_path))
    write(tmp_path / "a.txt")
    assert before < set(names(tmp_path))  # all of them may still be written
    for path in tmp_path.iterdir():
        os.utime(path, (time.time() - 90_000,) * 2, follow_symlinks=False)
    write(tmp_path / "a.txt")
    assert before - set(names(tmp_path)) == {draft.name for draft in swept}
    assert names(film) == ["0000.png"]
    assert (tmp_path / "mine" / "precious").read_text() == "mine"


@posix
@pytest.mark.skipif(os.name == "posix" and os.geteuid() != 0, reason="only root gives files away")
def test_a_draft_of_another_user_is_not_deleted(tmp_path):
    (tmp_path / DRAFT).write_text("half")
    os.utime(tmp_path / DRAFT, (time.time() - 90_000,) * 2)
    os.chown(tmp_path / DRAFT, 12345, 12345)
    write(tmp_path / "a.txt")
    assert names(tmp_path) == [DRAFT, "a.txt"]


def test_concurrent_writers_leave_one_complete_file(tmp_path):
    path = tmp_path / "a.txt"
    write(path, "0" * 5000)
    seen, faults, done = set(), [], threading.Event()

    def work(number):
        try:
            for _ in range(40):
                write(path, str(number) * 5000, durable=False)
        except OSError as fault:
            faults.append(fault)

    def look():
        while not done.is_set():
            seen.add(path.read_text())

    looker = threading.Thread(target=look)
    workers = [threading.Thread(target=work, args=(k,)) for k in range(6)]
    for thread in (looker, *workers):
        thread.start()
    for thread in workers:
        thread.join()
    done.set()
    looker.join()
    assert faults == []
    assert seen <= {str(k) * 5000 for k in range(6)}
    assert names(tmp_path) == ["a.txt"]
