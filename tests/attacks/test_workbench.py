"""The workbench attacked: tokens, cookies, foreign pages, endless bodies, damaged and hostile folders,
two workbenches on one folder, a kill, a full disk, and a clock that goes back."""

from __future__ import annotations

import asyncio
import errno
import http.client
import io
import json
import os
import signal
import stat
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import urlsplit

import numpy as np
import pytest

from mckibben import DataError, Recording
from mckibben.app import guard, kept, reading
from mckibben.app.folder import FOLDERS
from mckibben.app.guard import Guard, checked_token
from mckibben.app.jobs import Job, Jobs
from mckibben.app.pages.judging import judged
from mckibben.app.workspace import Workspace
from mckibben.files import write
from mckibben.registry import load
from mckibben.system.locks import keep_to_the_user

ROOT = Path(__file__).parents[2]
TOKEN = "a-token-of-tests"
HOST = (b"host", b"127.0.0.1:8750")

posix = pytest.mark.skipif(os.name != "posix", reason="rights and locks of POSIX")
linux = pytest.mark.skipif(sys.platform != "linux", reason="the system ends jobs on Linux alone")


def asked(
    *headers: tuple[bytes, bytes],
    path: str = f"/{TOKEN}/",
    body: list[bytes] | None = None,
    page: bytes = b"in",
    method: str = "GET",
) -> tuple[int, dict[bytes, bytes], bytes, int]:
    """Ask a guard, and return status, headers and content of the answer, and the parts it read."""
    parts = list(body or [b""])
    sent: list[Any] = []

    async def receive() -> Any:
        part = parts.pop(0) if parts else b""
        return {"type": "http.request", "body": part, "more_body": bool(parts)}

    async def send(message: Any) -> None:
        sent.append(message)

    async def inner(scope: Any, receive: Any, send: Any) -> None:
        while (message := await receive())["type"] == "http.request" and message["more_body"]:
            pass
        if message["type"] == "http.disconnect":
            raise ConnectionError
        await send(
            {"type": "http.response.start", "status": 200}
            | {"headers": [(b"content-type", b"text/html"), (b"content-length", b"2")]}
        )
        await send({"type": "http.response.body", "body": page})

    scope = {"type": "http", "method": method, "path": path, "headers": [HOST, *headers]}
    before = len(parts)
    made = Guard(inner, host="127.0.0.1", token=TOKEN)
    asyncio.run(made(scope, receive, send))
    return sent[0]["status"], dict(sent[0]["headers"]), sent[1]["body"], before - len(parts)


# -- tokens, cookies, foreign pages ----------------------------------------------------------


@pytest.mark.parametrize("token", ["", " ", " " * 20, "short", "ü" * 20, "a;b" * 9, "a" * 300])
def test_a_token_that_could_be_guessed_or_broken_is_refused(token: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="leave --token out"):
        checked_token(token)
    server = pytest.importorskip("mckibben.app.server")
    for host in ("127.0.0.1", "0.0.0.0"):
        with pytest.raises(DataError, match="leave --token out"):
            server.serve(tmp_path / "ws", host=host, token=token, show=False)
    assert not (tmp_path / "ws").exists()


@pytest.mark.parametrize(
    "path",
    ["/", "/ü" + TOKEN, "/\udcff\0", f"/?token={TOKEN}", f"/{TOKEN}", f"/{TOKEN.upper()}/", ""],
)
def test_strange_paths_are_refused_and_nothing_breaks(path: str) -> None:
    assert asked(path=path)[0] == 403
    assert asked((b"x-forwarded-prefix", f"/{TOKEN}".encode()), path=path)[0] == 403


@pytest.mark.parametrize(
    "others",
    [
        b'a="unclosed; ',
        b"{json: [1, 2]}; =; ;;; ",
        b"\xff\xfe=\x01; ",
        b"x=" + b"y" * 700_000 + b"; ",
    ],
)
def test_cookies_of_other_applications_lock_nobody_out(others: bytes) -> None:
    assert asked((b"cookie", others))[0] == 200


def test_foreign_pages_are_refused_with_the_token_too() -> None:
    for site, status in ((b"cross-site", 403), (b"same-site", 403), (b"same-origin", 200)):
        assert asked((b"sec-fetch-site", site))[0] == status


@pytest.mark.parametrize(
    ("method", "mode", "place", "status"),
    [
        ("GET", b"navigate", b"document", 200),
        ("POST", b"navigate", b"document", 403),
        ("GET", b"navigate", b"iframe", 403),
        ("GET", b"no-cors", b"image", 403),
        ("GET", b"websocket", b"websocket", 403),
    ],
)
def test_other_pages_may_lead_a_window_here_and_no_more(
    method: str, mode: bytes, place: bytes, status: int
) -> None:
    told = [(b"sec-fetch-site", b"cross-site"), (b"sec-fetch-mode", mode)]
    assert asked(*told, (b"sec-fetch-dest", place), method=method)[0] == status


def test_only_who_has_the_token_is_told_that_there_is_an_answer() -> None:
    """By which the page that waits for the start, a file, knows when to go on."""
    foreign, name = (b"sec-fetch-site", b"cross-site"), b"cross-origin-resource-policy"
    assert asked(foreign)[1][name] == b"cross-origin"
    assert asked(foreign, path="/a-guess-of-mine/")[1][name] == b"same-origin"
    assert asked((b"sec-fetch-site", b"same-origin"))[1][name] == b"same-origin"


def test_a_page_runs_its_own_scripts_alone() -> None:
    page = b'<head><script type="module">1</script></head>'
    status, headers, content, _ = asked(page=page)
    policy = headers[b"content-security-policy"].decode()
    (scripts,) = (part for part in policy.split("; ") if part.startswith("script-src "))
    assert "unsafe-inline" not in scripts
    assert "frame-ancestors 'none'" in policy
    nonce = scripts.partition("'nonce-")[2].partition("'")[0]
    assert content == page.replace(b"<script", b'<script nonce="%b"' % nonce.encode())
    assert int(headers[b"content-length"]) == len(content)
    assert status == 200
    again = asked(page=page)[1][b"content-security-policy"].decode()
    assert again != policy


# -- bodies without end ----------------------------------------------------------------------


def test_a_body_is_refused_before_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    length = (b"content-length", str(3 * 2**29).encode())
    status, _, _, read = asked(length, body=[b"x"] * 9)
    assert (status, read) == (413, 0)
    for lie in (b"-1", b"9" * 5000, b"ten"):
        assert asked((b"content-length", lie))[0] == 413


def test_a_body_that_does_not_tell_its_length_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "LARGEST_REQUEST", 1000)
    status, _, _, read = asked(body=[b"x" * 100] * 500)
    assert status == 413
    assert read == 11
    assert asked(body=[b"x" * 100] * 9)[0] == 200
    monkeypatch.setattr(guard, "AT_ONCE", 500)
    assert asked(body=[b"x" * 100] * 9)[0] == 413


@pytest.mark.parametrize("name", ["runs.zip", "runs.tar.gz", "runs.csv.ZIP", "x.py", "x"])
def test_archives_and_strangers_are_refused_and_not_kept(name: str, tmp_path: Path) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("../../run.csv", b"0" * 10**6)
    workspace = Workspace(tmp_path)
    with pytest.raises(DataError, match=r"unpack it|export as CSV"):
        workspace.keep_upload(name, packed.getvalue())
    assert not list((tmp_path / "uploads").iterdir())


def test_a_large_file_is_read_in_a_process_with_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.csv"
    write(recording(), path)
    monkeypatch.setattr(reading, "MOST_CELLS", 99)
    with pytest.raises(DataError, match="more than 99 numbers"):
        reading.read_upload(path)
    monkeypatch.undo()
    monkeypatch.setattr(reading, "LARGE", 0)
    (found,) = reading.read_upload(path)
    assert found == recording().with_meta(**found.meta)
    path.write_text("pressure_bar\nx\n")
    with pytest.raises(DataError, match="Remedy"):
        reading.read_upload(path)


# -- others on this machine ------------------------------------------------------------------


def recording() -> Recording:
    t = np.arange(50) * 0.1
    return Recording({"pressure": 2 + np.sin(t), "displacement": 10 + np.cos(t)}, 0.1)


@posix
def test_nobody_else_may_read_or_write_a_workspace(tmp_path: Path) -> None:
    mask = os.umask(0)
    try:
        old = tmp_path / "ws"
        (old / "recordings").mkdir(parents=True)
        (old / "recordings" / "old.csv").write_text("pressure_bar\n1\n")
        keep_to_the_user()
        workspace = Workspace(old)
        assert workspace.claim()
        workspace.add(recording(), origin="", call="")
        workspace.keep_upload("a.csv", b"1")
        workspace.log("did")
        load("blocks", "pi").example().save(workspace.new_path("models", "pi.json"))
        for path in (old, *old.rglob("*")):
            assert not stat.S_IMODE(path.stat().st_mode) & 0o077, path
    finally:
        os.umask(mask)


@posix
@pytest.mark.skipif(os.name == "posix" and os.getuid() != 0, reason="only root gives away")
@pytest.mark.parametrize("theirs", ["", "recordings"])
def test_a_workspace_of_another_user_is_refused(tmp_path: Path, theirs: str) -> None:
    Workspace(tmp_path / "ws")
    os.chown(tmp_path / "ws" / theirs, 65534, 65534)
    with pytest.raises(DataError, match=r"another user's.*Remedy"):
        Workspace(tmp_path / "ws")


@posix
@pytest.mark.parametrize("open_one", ["", "uploads"])
def test_a_workspace_that_stays_open_to_others_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, open_one: str
) -> None:
    workspace = Workspace(tmp_path / "ws")
    (tmp_path / "ws" / open_one).chmod(0o755)
    monkeypatch.setattr(Path, "chmod", lambda *_: None)  # as on a disk without rights
    with pytest.raises(DataError, match=r"other users.*Remedy"):
        workspace.claim()


@posix
def test_links_in_a_received_folder_lead_nowhere(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "file").write_text("mine")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "uploads").symlink_to(victim)
    with pytest.raises(DataError, match="link"):
        Workspace(tmp_path / "a")
    workspace = Workspace(tmp_path / "b")
    (tmp_path / "b" / "log.jsonl").symlink_to(victim / "file")
    (tmp_path / "b" / "models" / "x.json").symlink_to(victim / "file")
    with pytest.raises(DataError, match="cannot be written"):
        workspace.log("`touch pwned`")
    with pytest.raises(DataError, match="link"):
        workspace.path("models", "x.json")
    workspace.claim()
    assert (victim / "file").read_text() == "mine"


# -- one writer ------------------------------------------------------------------------------


@posix
def test_the_second_workbench_on_a_folder_reads_only(tmp_path: Path) -> None:
    first, second = Workspace(tmp_path), Workspace(tmp_path)
    assert first.claim()
    jobs = Jobs(first, at_once=1)
    first.write_json("jobs", "fit-pi", {"kind": "fit", "state": "running", "given": {}})
    assert not second.claim()
    assert "another workbench" in second.read_only
    first.add(recording(), origin="", call="", name="run")
    for change in (
        lambda: second.add(recording(), origin="", call=""),
        lambda: second.remove("run"),
        lambda: second.set_role("run", "test"),
        lambda: second.keep_upload("a.csv", b"1"),
        lambda: Jobs(second).submit("fit", {"model": "pi", "name": "pi"}),
        lambda: Jobs(second).cancel("fit-pi"),
        lambda: Jobs(second).forget("fit-pi"),
        lambda: second.new_path("takeaway", "x.json"),
    ):
        with pytest.raises(DataError, match="nothing can be changed here"):
            change()
    assert len(second.with_role("train")) == 1
    assert Jobs(second).jobs["fit-pi"].state == "running"
    jobs.close()


CLAIMING = """
import sys, time
from mckibben.app.workspace import Workspace
workspace = Workspace(sys.argv[1])
assert workspace.claim()
print("claimed", flush=True)
time.sleep(60)
"""

HOLDING = """
import ctypes, multiprocessing, os, sys, time
from mckibben.app.workspace import Workspace
from mckibben.system.workers import end_with_parent

def hold(folder):
    end_with_parent()
    held = Workspace(folder).work()
    print(os.getpid(), flush=True)
    ctypes.PyDLL(None).sleep(60)  # as compiled code that lets no other thread run

if __name__ == "__main__":
    process = multiprocessing.get_context("forkserver").Process(target=hold, args=sys.argv[1:])
    process.start()
    process.join()
"""


def killed(script: str, folder: Path) -> str:
    """Run a script until it says something, kill it, and return what it said."""
    file = folder.parent / "script.py"
    file.write_text(script)
    process = subprocess.Popen(
        [sys.executable, str(file), str(folder)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    said = process.stdout.readline()
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    return said


@posix
def test_a_killed_workbench_leaves_the_folder_to_the_next(tmp_path: Path) -> None:
    assert killed(CLAIMING, tmp_path / "ws") == "claimed\n"
    assert Workspace(tmp_path / "ws").claim()


def _has_ended(status: Path) -> bool:
    """Tell whether a process is gone, or waits only to be asked how it ended."""
    try:
        return status.read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


@linux
def test_a_job_ends_with_a_killed_workbench_whatever_it_is_at(tmp_path: Path) -> None:
    number = int(killed(HOLDING, tmp_path / "ws"))
    assert Workspace(tmp_path / "ws").claim()  # waits for those that write, for some seconds
    status = Path(f"/proc/{number}/stat")
    until = time.monotonic() + 10  # its locks fall a moment before it is gone
    while not (ended := _has_ended(status)) and time.monotonic() < until:
        time.sleep(0.01)
    assert ended


@posix
def test_while_a_job_of_a_killed_workbench_lives_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mckibben.app.folder.PATIENCE", 0.1)
    held = Workspace(tmp_path).work()
    second = Workspace(tmp_path)
    assert not second.claim()
    assert "have not ended" in second.read_only
    held.leave()


def test_names_are_taken_on_the_disk(tmp_path: Path) -> None:
    workspaces = [Workspace(tmp_path) for _ in range(4)]
    with ThreadPoolExecutor(8) as pool:
        names = list(pool.map(lambda n: workspaces[n % 4].new_name("models", "pi"), range(40)))
    assert len(set(names)) == 40


class Idle(Jobs):
    """Jobs that are queued and never start."""

    def poll(self) -> bool:
        """Start none."""
        return False


def test_six_jobs_of_one_wish_have_six_names(tmp_path: Path) -> None:
    jobs = Idle(Workspace(tmp_path))
    six = [jobs.submit("fit", {"model": "pi", "name": "pi", "seed": k}) for k in range(6)]
    names = {job.given["name"] for job in six}
    assert len(names) == len({job.name for job in six}) == 6
    assert jobs.submit("fit", {"model": "pi", "name": "pi", "seed": 0}) is six[0]
    jobs.close()
    assert list((tmp_path / "models").iterdir()) == []


# -- damaged folders -------------------------------------------------------------------------

RUBBISH: list[Any] = [None, 1, -1e999, "text", [], [[]], {"": {}}, True, "\u202e\0", 10**400]


def test_damaged_lines_cost_themselves(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.log("first", "call()")
    lines = [b"null", b"3", b"[]", b'"x"', b"\xff\xfe", b"{}", b'{"did": 3}', b"[" * 90_000]
    lines += [b'{"did": "x", "call": null}', b'{"did": "\\ud800", "call": ""}', b"\0" * 50]
    with (tmp_path / "log.jsonl").open("ab") as file:
        file.write(b"\n".join(lines) + b"\n")
    workspace.log("last", "call()")
    assert [entry["did"] for entry in workspace.logged()] == ["first", "last"]
    assert kept.progress(b"0 0 nan\nnan 0 1\n1 x 1\n\xff\n0.5 0.5 1e999\n1 2\n1 7 1\n") == [
        (0.0, 0.0, pytest.approx(float("nan"), nan_ok=True)),
        (0.5, 0.5, float("inf")),
    ]


GOOD: dict[str, dict[str, Any]] = {
    "recordings": {"role": "train", "origin": "", "call": "", "file": "good.csv", "notes": []},
    "results": {"status": "ok", "model": "pi", "settings": {}, "validation_rmse": 1.0}
    | {"test": {"rmse": 1.0, "r2": 0.9, "rmse_interval": [0.9, 1.1]}, "train": {"rmse": 1.0}}
    | {"memory": {"gap_ratio": 0.9}, "n_parameters": 3, "fit_seconds": 1.0},
    "jobs": {"kind": "fit", "state": "done", "message": "", "given": {"model": "pi", "name": "x"}},
    "runs": {"model": "pi", "rig": "r", "controller": "pid", "rmse": {"displacement": 1.0}}
    | {"largest": {"displacement": 1.0}, "clipped": 0, "step_us": 1.0},
}


def test_wrong_types_anywhere_cost_their_file(tmp_path: Path) -> None:
    """Every value of every file that is kept, at any depth, replaced by rubbish of every kind."""
    workspace = Workspace(tmp_path)
    workspace.add(recording(), origin="", call="", name="good")

    def spoilt(value: Any) -> Iterator[Any]:
        yield from RUBBISH
        if isinstance(value, dict):
            for key in value:
                yield {name: item for name, item in value.items() if name != key}
                for other in spoilt(value[key]):
                    yield value | {key: other}

    for kind, good in GOOD.items():
        if kind != "recordings":
            workspace.write_json(kind, "good", good)
        for bad in spoilt(good):
            text = json.dumps(bad)
            (tmp_path / kind / "bad.json").write_text(text)
            assert "good" in [entry.name for entry in workspace.entries()]
            json.dumps(found := workspace.results()).encode()
            assert all(isinstance(row["settings"], dict) for row in found)
            for run in workspace.runs("pi").values():
                assert all(v is None or np.isfinite(v) for v in run.rmse.values())
            for job in Idle(workspace).jobs.values():
                job.title.encode()
                assert isinstance(job.message, str)
        (tmp_path / kind / "bad.json").unlink()
    assert "good" in workspace.runs("pi")
    assert "good" in Jobs(workspace).jobs


def test_a_pipe_in_the_folder_holds_nobody_up(tmp_path: Path) -> None:
    if not hasattr(os, "mkfifo"):
        pytest.skip("there are no pipes in folders here")
    workspace = Workspace(tmp_path)
    for place in ("recordings/x.json", "models/x.json", "results/x.json", "jobs/x.json"):
        os.mkfifo(tmp_path / place)
    os.mkfifo(tmp_path / "log.jsonl")
    with pytest.raises(DataError):
        workspace.log("x")
    workspace.warm()
    assert [*workspace.logged(), *workspace.entries(), *workspace.results()] == []
    assert Jobs(workspace).jobs == {}


# -- a full disk, and a clock ----------------------------------------------------------------


def full(*_: object, **__: object) -> NoReturn:
    """Fail as a full disk does."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class Ended:
    """A process that has ended."""

    exitcode = 0

    def is_alive(self) -> bool:
        """Tell that it has."""
        return False


def test_a_full_disk_is_told_and_jobs_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    workspace = Workspace(tmp_path)
    jobs = Jobs(workspace, at_once=1)
    process: Any = Ended()
    jobs.jobs["fit"] = Job("fit", "fit", {"name": "pi"}, "running", process=process)
    monkeypatch.setattr(Path, "write_text", full)
    monkeypatch.setattr(Path, "write_bytes", full)
    monkeypatch.setattr(os, "fdopen", full)
    for attempt in (
        lambda: workspace.write_json("results", "x", {}),
        lambda: workspace.log("x"),
        lambda: workspace.keep_upload("a.csv", b"1"),
        lambda: workspace.add(recording(), origin="", call="", name="run"),
    ):
        with pytest.raises(DataError, match=r"x\.json|log\.jsonl|a\.csv|run") as caught:
            attempt()
        assert "No space left" in str(caught.value)
    assert jobs.poll()
    assert jobs.jobs["fit"].state == "failed"
    assert all("No space left" in text for text in jobs.untold)
    assert len(jobs.untold) == 2
    monkeypatch.undo()
    assert [path for name in FOLDERS for path in (tmp_path / name).iterdir()] == []


def test_a_clock_set_back_hides_no_change(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    given = recording()
    path = workspace.add(given, origin="", call="", name="run").path
    assert workspace.recording("run")["pressure"][0] == 2.0
    moment = path.stat().st_mtime_ns
    write(Recording({name: given[name] + 1.0 for name in given.channels}, 0.1), path)
    os.utime(path, ns=(moment, moment))
    assert workspace.recording("run")["pressure"][0] == 3.0


def test_models_are_loaded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    workspace = Workspace(tmp_path)
    load("blocks", "pi").example().save(workspace.path("models", "pi.json"))
    (tmp_path / "models" / "bad.json").write_text("{}")
    assert workspace.models() == ["pi"]
    monkeypatch.setattr("mckibben.blocks.core.saving.load", full)
    assert workspace.models() == ["pi"]
    os.utime(tmp_path / "models" / "pi.json", (0, 0))
    assert workspace.models() == []


# -- the server itself -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, str, int]]:
    """Start a workbench, and give its port, token and process."""
    pytest.importorskip("nicegui")
    folder = tmp_path_factory.mktemp("served") / "ws"
    plain = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    process = subprocess.Popen(
        [sys.executable, "-m", "mckibben.cli.main", "app", str(folder), "--port", "0", "--no-show"],
        stdout=subprocess.PIPE,
        text=True,
        env=plain,
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    address = next(word for word in line.split() if word.startswith("http"))
    port = int(address.split(":")[2].split("/")[0])
    for _ in range(400):
        try:
            fetched(port, "/")
        except OSError:
            time.sleep(0.05)
        else:
            break
    yield port, urlsplit(address).path.strip("/"), process.pid
    process.terminate()
    process.wait(20)
    process.stdout.close()


def fetched(
    port: int, path: str, headers: dict[str, str] | None = None, method: str = "GET"
) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request(method, path, headers=headers or {})
    answer = connection.getresponse()
    answer.body = answer.read()  # type: ignore[attr-defined]  # kept beyond the connection
    connection.close()
    return answer


def test_who_lacks_the_token_gets_nothing(served: tuple[int, str, int]) -> None:
    port, token, _ = served
    static = "/_nicegui/static/nicegui.js"
    socket = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"
    for path in ("/", static, socket, "/docs", "/none", "/favicon.ico"):
        assert fetched(port, path).status == 403
        assert fetched(port, f"/a-guess-of-mine-{port}{path}").status == 403
    page = fetched(port, f"/{token}/")
    assert page.status == 200
    assert "'nonce-" in str(page.headers["content-security-policy"])
    assert page.headers["set-cookie"] is None
    large = {"Content-Length": str(3 * 2**29)}
    assert fetched(port, f"/{token}/_nicegui/client/x/upload/1", large, "POST").status == 413


@linux
def test_hundreds_of_foreign_requests_take_no_memory(served: tuple[int, str, int]) -> None:
    port, token, process = served
    foreign = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}
    for path in ("/", f"/{token}/"):
        assert {fetched(port, path, foreign).status for _ in range(150)} == {403}
    for _ in range(40):  # pages that nobody opens
        assert fetched(port, f"/{token}/").status == 200
    status = Path(f"/proc/{process}/status").read_text()
    resident = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    assert int(resident.split()[1]) < 600 * 1024


def test_what_speaks_against_a_model_reaches_the_page(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    against = {"not_recommended": "Nothing speaks for it.", "shared": ["It was fitted to."]}
    result = {"status": "ok", "model": "pi", "constant": {"test": {"rmse": 3.0}}} | against
    workspace.write_json("results", "pi", result)
    constant, *said = judged(workspace.results())
    assert "test RMSE 3" in constant
    assert said == ["Nothing speaks for it.", "pi: It was fitted to."]
