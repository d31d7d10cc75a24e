"""Lives of clients: apart from each other, continued, restarted, and gone without a trace."""

from __future__ import annotations

import asyncio
import gc
import operator
import os
import re
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("aiohttp")

from visitors import LIMITS, STANDIN, serving

from vtk_segdeform.widgets.web.serving.run_folder import run_folder

PATIENCE = 300.0  # seconds of a machine that is busy; only failures take as long
KEEP = 1000.0  # seconds without a page: more than any test takes
ON_LINUX = pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc")
# The command line with a stand-in for the client process.
PROGRAM = f"""
import sys, tempfile
from vtk_segdeform.cli import main
from vtk_segdeform.widgets.web.serving import server
server.client_command = lambda file: {STANDIN!r}
tempfile.tempdir = sys.argv[1]
sys.exit(main(["serve", "--port", "0"]))
"""


def is_alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


async def until(true):
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, "did not happen"
        await asyncio.sleep(0.02)


async def pass_by(seconds):
    """Let *seconds* pass on the server's clock, and everything happen that they bring."""
    for _ in range(3):
        await asyncio.sleep(0.05)
    asyncio.get_running_loop().put_forward(seconds)


@ON_LINUX
def test_the_life_of_two_clients(do, tmp_path):
    """They are apart, and survive a reload, a crash and a third visitor."""

    async def story():
        limits = replace(LIMITS, clients=2)
        async with serving(tmp_path, limits) as (server, visitor):
            one, other, third = visitor(), visitor(), visitor()
            (first, _), (second, _) = await asyncio.gather(one.enter(), other.enter())
            assert first != second
            await one.ask("set pulled")
            assert await one.ask("get") == "pulled"
            assert await other.ask("get") == ""
            for cookie in (other.cookie, "", one.cookie[:-1]):
                status, text, _ = await one.get(f"{one.path}index.html", Cookie=cookie)
                assert status == 403
                assert "pulled" not in text
            assert await one.load() == (first, "pulled")

            async with one.socket(), other.socket():
                status, text, _ = await third.get(f"/?token={server.access.token}")
            assert (status, text[:27]) == (503, "All 2 clients of this serve")

            async with one.socket() as socket:
                os.kill(first, signal.SIGKILL)
                closed = await socket.receive(PATIENCE)
                assert closed.data == 4000
                assert "ended unexpectedly" in closed.extra
            again, state = await one.load()
            assert again != first
            assert state == "pulled"
            assert await other.ask("get") == ""

            folder = next(tmp_path.iterdir())
            assert folder.stat().st_mode & 0o777 == 0o700
            assert sum(each.is_dir() for each in folder.iterdir()) == 2
        assert not is_alive(again)
        assert not is_alive(second)
        assert list(tmp_path.iterdir()) == []

    do(story())


@ON_LINUX
def test_a_client_ends_some_time_after_its_page(do, tmp_path):
    async def story():
        async with serving(tmp_path, replace(LIMITS, clients=1, keep=KEEP)) as (server, visitor):
            guest, folder = visitor(), next(tmp_path.iterdir())
            process, _ = await guest.enter()
            async with guest.socket() as socket:
                await pass_by(1.6 * KEEP)
                await socket.send_str("get")
                assert (await socket.receive(PATIENCE)).data == ""
                assert is_alive(process)
            await pass_by(0.5 * KEEP)
            assert (await guest.load())[0] == process
            await pass_by(1.1 * KEEP)
            await until(lambda: not is_alive(process))
            await until(lambda: [each.name for each in folder.iterdir()] == ["lock"])
            assert server.clients.is_empty
            assert (await guest.get(guest.path))[0] == 403

    do(story())


@pytest.mark.campaign
@ON_LINUX
def test_the_address_continues_the_work_of_a_page_that_has_gone_on_this_machine_only(do, tmp_path):
    async def story():
        async with serving(tmp_path, replace(LIMITS, clients=6, keep=KEEP)) as (server, visitor):
            one = visitor()
            first, _ = await one.enter()
            async with one.socket() as socket:
                await socket.send_str("set pulled")
                await socket.receive(PATIENCE)
                await pass_by(100.0)
                second, _ = await visitor().enter()
                assert second != first  # whose page is open
            third, _ = await visitor().enter()
            assert third not in (first, second)  # it may be loading again
            await pass_by(100.0)
            server.host = "0.0.0.0"
            fourth, state = await visitor().enter()
            assert fourth not in (first, second, third)
            assert state == ""
            server.host = "127.0.0.1"
            two = [await visitor().get(f"/?token={server.access.token}") for _ in range(2)]
            assert two[0][2]["Location"] == one.path
            assert two[1][2]["Location"] != one.path  # the first one is loading
            await pass_by(100.0)
            assert await visitor().enter() == (first, "pulled")

    do(story())


@pytest.mark.campaign
@ON_LINUX
def test_a_process_that_takes_too_much_memory_is_ended_by_name(do, tmp_path):
    async def story():
        async with serving(tmp_path, replace(LIMITS, memory=150_000_000)) as (_, visitor):
            guest = visitor()
            process, _ = await guest.enter()
            await guest.ask("set pulled")
            async with guest.socket() as socket:
                await socket.send_str("take 200")
                closed = await socket.receive(PATIENCE)
                if closed.data == "take 200":
                    asyncio.get_running_loop().put_forward(2.0)  # to the next look
                    closed = await socket.receive(PATIENCE)
            assert closed.data == 4000
            assert closed.extra == "The editor took more than 0.15 GB of memory."
            await until(lambda: not is_alive(process))
            assert (await guest.load())[1] == "pulled"
            with pytest.raises(Exception, match=r"payload|disconnected|reset"):
                await guest.get(f"{guest.path}fail")  # half an answer is not taken for all of it

    do(story())


@ON_LINUX
@pytest.mark.parametrize(
    ("command", "reason", "tries"),
    [
        ([*STANDIN, "broken"], "broken cannot be read.", 2),
        ([sys.executable, "-c", "import time; time.sleep(1000)"], "The editor did not start", 1),
        ([sys.executable, "-c", "1 / 0"], "The editor could not be started.", 1),
        ([sys.executable, "-c", "print('hello')"], "The editor could not be started.", 1),
        ([sys.executable, "-c", r"""print('{"error": "Not \\u001b[31mred."}')"""], "[31mred.", 1),
        (["/no/such/program"], "The editor could not be started.", 1),
    ],
)
def test_a_process_that_cannot_start_says_why_in_the_page(
    do, tmp_path, caplog, command, reason, tries
):
    before = children()  # an X server of other tests, for example

    async def story():
        limits = replace(LIMITS, start=0.1 if "sleep" in command[-1] else PATIENCE)
        async with serving(tmp_path, limits, command) as (server, visitor):
            guest = visitor()
            _, _, headers = await guest.get(f"/?token={server.access.token}")
            guest.path, guest.cookie = headers["Location"], headers["Set-Cookie"].split(";")[0]
            for _ in range(tries):  # a reload tries again
                assert (await guest.get(guest.path))[0] == 202
                status, text, _ = await guest.get(guest.path)
                assert status == 502
                assert reason in text
                assert "Reload this page to try again." in text
            assert (await guest.get(f"{guest.path}headers"))[0] == 502
            await until(lambda: children() <= before)

    do(story())
    assert reason in caplog.text
    assert "\x1b" not in caplog.text


def children():
    """Return the ids of the child processes of this one."""
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())


def memory_used():
    """Return the resident memory of this process in bytes."""
    pages = Path("/proc/self/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def left_behind():
    """Return the numbers of child processes, threads and open files, and of tasks."""
    gc.collect()
    return (
        len(children()), threading.active_count(), len(os.listdir("/proc/self/fd")),
        len(asyncio.all_tasks()),
    )  # fmt: skip


@ON_LINUX
@pytest.mark.parametrize("rounds", [1, pytest.param(16, marks=pytest.mark.campaign)])
def test_visits_leave_nothing_behind(do, tmp_path, rounds):
    others = children()

    async def story():
        limits = replace(LIMITS, clients=3, keep=KEEP)
        async with serving(tmp_path, limits) as (server, visitor):
            (folder,) = tmp_path.iterdir()

            async def visit():
                guest = visitor()
                await guest.enter()
                await guest.ask("set pulled")  # each opens a WebSocket and closes it
                assert await guest.ask("get") == "pulled"

            async def leave():
                await pass_by(1.1 * KEEP)
                await until(lambda: server.clients.is_empty)

            await visit()
            await leave()
            await until(lambda: children() <= others)
            before, memory = left_behind(), 0
            for _ in range(rounds):
                await asyncio.gather(*[visit() for _ in range(2 if rounds == 1 else 3)])
                await leave()
                memory = memory or memory_used()  # after the first round
            await until(lambda: all(map(operator.le, left_behind(), before)))
            assert memory_used() - memory < 3e6
            # A client's folder is deleted after its process has ended.
            await until(lambda: [each.name for each in folder.iterdir()] == ["lock"])

    do(story())


def started(folder):
    """Run the program; return it and the address that it prints."""
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(folder)], stdout=subprocess.PIPE, text=True
    )
    line = program.stdout.readline()
    return program, re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", line)[0]


@ON_LINUX
@pytest.mark.parametrize(
    "how", [pytest.param(signal.SIGTERM, marks=pytest.mark.campaign), signal.SIGKILL]
)
def test_however_the_program_ends_its_clients_end(do, tmp_path, how):
    """`test_served_pages` ends a program by SIGTERM."""
    from types import SimpleNamespace

    import aiohttp
    from visitors import Visitor

    program, address = started(tmp_path)

    async def story():
        base, token = address.split("/?token=")
        access = SimpleNamespace(token=token)
        server = SimpleNamespace(port=int(base.rpartition(":")[2]), access=access)
        async with aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as session:
            guest = Visitor(server, session)
            process, _ = await guest.enter()
            async with guest.socket():
                assert is_alive(process)
                program.send_signal(how)
                await until(lambda: not is_alive(process))

    try:
        do(story())
        assert program.wait(PATIENCE) == (-how if how == signal.SIGKILL else 0)
    finally:
        program.kill()
        program.communicate()
    assert len(list(tmp_path.iterdir())) == (how == signal.SIGKILL)
    with run_folder(tmp_path) as folder:  # the next server deletes what a killed one left
        assert list(tmp_path.iterdir()) == [folder]


def test_folders_of_others_are_never_deleted(tmp_path):
    named = [tmp_path / f"segdeform-serve-{digit * 16}" for digit in "0123"]
    for folder in named[:3]:
        folder.mkdir()
    (named[1] / "lock").write_text("another program's\n")
    (named[2] / "lock").mkdir()
    work = tmp_path / "work"
    work.mkdir()
    (work / "lock").write_bytes(b"vtk_segdeform: private folder of segdeform serve\n")
    named[3].symlink_to(work)
    with run_folder(tmp_path) as running, run_folder(tmp_path):  # nor is that of a running server
        assert running.is_dir()
    assert sorted(tmp_path.iterdir()) == [*named, work]
    assert (work / "lock").exists()
