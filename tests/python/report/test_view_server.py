# SPDX-License-Identifier: Apache-2.0
"""The server of `activestereo view`: it answers its own page, and nobody else."""

import http.client
import json
import struct
import random
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext

import numpy as np
import pytest

from activestereo.benchmarks.generate.bop import write_head
from activestereo.camera.presets import StereoDepthSensorConfig
from activestereo.capture.capture import SIDES
from activestereo.capture.images import write_gray
from activestereo.common.own_files import outside_allowed, own_file
from activestereo.cli import make_parser
from activestereo.cli.view import make_server
from activestereo.compare.depth_compare import DepthModel
from activestereo.effects import builtin
from activestereo.report.view.library import Library, pictures_capture
from activestereo.report.view.routes import Routes, free_name, packed
from activestereo.report.view.server import ViewServer
from activestereo.report.view.settings import settings_of
from activestereo.report.view.simulation import Pictures, Superseded
from activestereo.sensor.results import cameras_json
from command_line import refused


def unpacked(answer):
    """The content and the images of an answer."""
    (length,) = struct.unpack_from("<I", answer)
    content = json.loads(answer[4 : 4 + length])
    images = {}
    for name, (kind, height, width, first) in content.pop("arrays").items():
        flat = np.frombuffer(answer, np.dtype(kind).newbyteorder("<"), height * width, 4 + length + first)
        images[name] = flat.reshape(height, width)
    return content, images


def _wrong(given):
    raise ValueError(f"the value is\nwrong{given.get('value', '')}")


class Client:
    """Requests to a server as its own page sends them, but for what a test changes."""

    def __init__(self, server):
        self.port, self.token = server.server_port, server.token

    def ask(self, method="GET", path="", body=None, token=None, **headers):
        """(status, headers, content). headers: with _ for -; None leaves one out."""
        own = {"Host": f"127.0.0.1:{self.port}"}
        if method == "POST":
            own |= {"Origin": f"http://127.0.0.1:{self.port}", "Content-Type": "application/json"}
        own |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        connection.putrequest(method, f"/{self.token if token is None else token}/{path}", skip_host=True)
        for name, value in own.items():
            if value is not None:
                connection.putheader(name, value)
        if body is not None and "Content-Length" not in own:
            connection.putheader("Content-Length", str(len(body)))
        connection.endheaders(body)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        return answer.status, dict(answer.getheaders()), content

    def call(self, name, given=None, **headers):
        return self.ask("POST", name, json.dumps({} if given is None else given).encode(), **headers)


@contextmanager
def serving(server):
    """A server that answers in a thread of its own."""
    with server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture(scope="module")
def server():
    calls = {"echo": lambda given: packed({"given": given}), "wrong": _wrong, "fault": lambda given: 1 / 0}
    with serving(ViewServer(calls)) as server:
        yield server


@pytest.fixture
def client(server):
    return Client(server)


def test_the_page_its_files_and_its_calls_are_answered(client):
    status, headers, page = client.ask()
    assert status == 200 and b"<title>" in page
    assert page.count(b'waiting empty">') == 4  # no black box before the first answer
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    status, _, answer = client.call("echo", {"a": [1.5]})
    assert status == 200 and unpacked(answer) == ({"given": {"a": [1.5]}}, {})
    names = [part.split(b'"')[0].decode() for mark in (b'src="', b'href="') for part in page.split(mark)[1:]]
    assert len(names) >= 6
    for name in names:
        assert client.ask(path=name)[0] == 200, name


def test_it_listens_on_the_loopback_address_alone(server):
    assert server.server_address[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.server_port}/{server.token}/"
    assert len(server.token) >= 32


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"}, {"Host": "127.0.0.1"}, {"Host": "127.0.0.1:1"}, {"Host": None},
        {"Host": "evil.example:80"}, {"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": ""},
        {"Origin": "https://127.0.0.1:80"}, {"Sec_Fetch_Site": "cross-site"}, {"Sec_Fetch_Site": "same-site"},
    ],
)  # fmt: skip
def test_another_host_or_origin_is_refused(client, headers):
    assert client.ask(**headers)[0] == 403
    assert client.call("echo", **headers)[0] == 403


def test_another_servers_page_is_of_another_origin(client):
    assert client.call("echo", Origin=f"http://127.0.0.1:{client.port + 1}")[0] == 403
    other_name = {"Host": f"localhost:{client.port}", "Origin": f"http://127.0.0.1:{client.port}"}
    assert client.call("echo", **other_name)[0] == 403
    assert client.call("echo", **(other_name | {"Origin": f"http://localhost:{client.port}"}))[0] == 200


@pytest.mark.parametrize("token", ["", "x", "..", "%2e%2e", "%C3%BC"])
def test_without_the_token_there_is_nothing(client, token):
    assert client.ask(token=token)[0] == 404
    assert client.call("echo", token=token)[0] == 404
    assert client.call("echo", token=client.token[:-1])[0] == 404


@pytest.mark.parametrize(
    "path", ["../server.py", "..%2fserver.py", "/etc/passwd", "view/view.html", "view.js/", "echo", "%00", "page.html"]
)
def test_files_outside_of_the_page_are_refused(client, path):
    assert client.ask(path=path)[0] == 404


@pytest.mark.parametrize(
    "status, headers, body",
    [
        (403, {"Origin": None}, b"{}"), (415, {"Content_Type": "text/plain"}, b"{}"),
        (415, {"Content_Type": None}, b""),
        (411, {"Content-Length": "x"}, None), (411, {"Content-Length": "-1"}, None), (411, {}, None),
        (413, {"Content-Length": "99999999"}, None), (400, {}, b"{"), (400, {}, b"[1]"), (400, {}, b"\xff"),
        (400, {}, b"[" * 100_000),
    ],
)  # fmt: skip
def test_a_bad_call_is_refused(client, status, headers, body):
    assert client.ask("POST", "echo", body, **headers)[0] == status


def test_an_unknown_call_and_a_wrong_value_are_told(client):
    assert client.call("nothing")[0] == 404
    status, _, text = client.call("wrong")
    assert (status, text) == (400, b"the value is wrong")
    status, _, text = client.call("wrong", {"value": "\ud800"})  # half a character, which has no bytes in UTF-8
    assert (status, text) == (400, rb"the value is wrong\ud800")


def test_a_thousand_bad_requests_do_not_bring_it_down(server, client, capfd):
    """Broken lines, endless headers, wrong methods, calls of others, connections that end in the middle."""
    numbers = random.Random(37)
    own = f"Host: 127.0.0.1:{client.port}\r\n".encode()
    shapes = [
        lambda: numbers.randbytes(200),
        lambda: b"GET / HTTP/9.9\r\n\r\n",
        lambda: b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n",
        lambda: b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 200 + b"\r\n",
        lambda: b"DELETE /x HTTP/1.1\r\n" + own + b"\r\n",
        lambda: f"POST /{client.token}/echo HTTP/1.1\r\n".encode() + own + b"Content-Length: 50\r\n\r\n{}",
        lambda: f"GET /{client.token}/".encode(),
        lambda: b"",
    ]
    for number in range(1000):
        with socket.create_connection(("127.0.0.1", client.port), timeout=10) as connection:
            try:
                connection.sendall(shapes[number % len(shapes)]())
                connection.shutdown(socket.SHUT_WR)
                while connection.recv(1 << 16):
                    pass
            except ConnectionError:  # it did not want to read more
                pass
    assert client.call("echo", {"still": "there"})[0] == 200
    end = time.monotonic() + 10
    while threading.active_count() > 10 and time.monotonic() < end:
        time.sleep(0.05)
    assert threading.active_count() <= 10
    assert capfd.readouterr() == ("", "")


def test_a_number_of_many_digits_is_refused():
    with pytest.raises(ValueError, match=r"haze\.extinction_per_m is a whole number of 1333 bits"):
        settings_of({"effects": {"haze": {"extinction_per_m": 10**401}}}, builtin(), [])


def test_a_fault_of_the_program_is_told_and_the_next_call_answered(client):
    status, _, text = client.call("fault")
    assert (status, text) == (500, b"a fault of the program: ZeroDivisionError('division by zero')")
    assert client.call("echo")[0] == 200


def test_calls_beyond_those_that_it_can_make_in_time_are_told_so():
    go, answers = threading.Event(), []
    with serving(ViewServer({"wait": lambda given: go.wait(60) and b""})) as server:
        ask = lambda: answers.append(Client(server).call("wait"))  # noqa: E731
        asked = [threading.Thread(target=ask) for _ in range(200)]
        for thread in asked:
            thread.start()
        end = time.monotonic() + 60
        while len(answers) < 200 - 16 and time.monotonic() < end:
            time.sleep(0.02)
        assert len(answers) == 200 - 16
        assert all(status == 503 and b"busy" in text for status, _, text in answers)
        go.set()
        for thread in asked:
            thread.join()
        assert [status for status, _, _ in answers].count(200) == 16


def test_more_connections_than_it_has_threads_for_are_told_and_closed(server, client):
    silent = [socket.create_connection(("127.0.0.1", client.port), timeout=10) for _ in range(70)]
    closed = sum(connection.recv(1000).startswith(b"HTTP/1.1 503") for connection in silent[64:])
    for connection in silent:
        connection.close()
    assert closed == 6
    end = time.monotonic() + 10
    while time.monotonic() < end:  # the silent ones are noticed to have gone
        try:
            if client.ask()[0] == 200:
                return
        except (ConnectionError, http.client.BadStatusLine):
            pass
        time.sleep(0.05)
    raise AssertionError("the server answers no more")


def test_what_the_command_line_allows_holds_in_its_threads(tmp_path):
    (tmp_path / "inside").mkdir()
    (tmp_path / "beside").write_text("")
    call = {"look": lambda given: packed({"found": own_file(tmp_path / "inside", "../beside").name})}
    for allowed, status in ((outside_allowed(), 200), (nullcontext(), 400)):
        with allowed:
            server = ViewServer(call)
        with serving(server):
            assert Client(server).call("look")[0] == status


def test_a_library_opens_what_it_lists_and_nothing_else(tmp_path):
    folder, outside = tmp_path / "folder", tmp_path / "outside"
    for capture in (folder / "one", folder / "deeper" / "two", outside):
        capture.mkdir(parents=True)
        (capture / "capture.json").write_text("{}")
    (folder / "scene.gltf").write_text("{}")
    (folder / "one" / "scene.gltf").write_text("{}")
    (folder / "link").symlink_to(outside)
    (folder / "text").write_text("{}")
    library = Library(folder, lambda path: path)
    assert library.names == ["deeper/two", "one", "scene.gltf"]
    assert library.source("one") == folder / "one"
    for name in ("../outside", "link", "/etc/passwd", "deeper", "one/scene.gltf", "", None, ["one"], 1):
        with pytest.raises(ValueError, match="outside of the folder"):
            library.source(name)
    assert Library(folder / "one", lambda path: path).names == ["."]
    with pytest.raises(ValueError, match="neither a capture"):
        Library(folder / "text", lambda path: path)
    with pytest.raises(ValueError, match="no such file"):
        Library(folder / "nothing", lambda path: path)


class _Slow:
    """A source and its simulation, whose pictures wait until they are let go or nobody wants them."""

    title = "slow"

    def __init__(self):
        self.began, self.go = threading.Semaphore(0), threading.Event()

    def simulation(self):
        return self

    def material_names(self):
        return []

    def exposure(self, frame):
        return frame

    def picture(self, exposure, settings, is_draft, is_wanted):
        self.began.release()
        while not self.go.is_set():
            if not is_wanted():
                raise Superseded
            time.sleep(0.002)
        image = np.full((2, 3), settings.gain, np.float32)
        return Pictures(image, image, image)


def test_a_later_setting_of_the_same_page_ends_an_earlier_one(tmp_path):
    (tmp_path / "scene.gltf").write_text("{}")
    source = _Slow()
    routes = Routes(Library(tmp_path / "scene.gltf", lambda path: source), {}, tmp_path / "model.json")
    answers = {}

    def ask(page, serial):
        given = {"entry": ".", "frame": 0, "settings": {"gain": serial}, "page": page, "serial": serial}
        answers[page, serial] = unpacked(routes.simulate(given))

    asked = [threading.Thread(target=ask, args=one) for one in ((1, 5), (2, 1), (1, 7), (1, 6))]
    for thread in asked:  # number 6 comes after 7: it is late, and not the newest
        thread.start()
        assert source.began.acquire(timeout=10)
    asked[0].join(timeout=10)
    asked[3].join(timeout=10)
    source.go.set()
    for thread in asked:
        thread.join(timeout=10)
    assert {key for key, (content, _) in answers.items() if content.get("superseded")} == {(1, 5), (1, 6)}
    assert answers[1, 7][1]["left"][0, 0] == 7.0 and answers[2, 1][1]["left"][0, 0] == 1.0


def test_saves_at_one_time_have_names_of_their_own(tmp_path):
    def save(number):
        with free_name(tmp_path / "model.json") as path:
            path.write_text(str(number))

    with ThreadPoolExecutor(16) as pool:
        list(pool.map(save, range(64)))
    assert sorted(int(path.read_text()) for path in tmp_path.iterdir()) == list(range(64))
    with pytest.raises(OSError), free_name(tmp_path / "other.json"):
        raise OSError("a full disk")
    assert not (tmp_path / "other.json").exists()


def test_simulated_pairs_are_shown_with_the_cameras_that_took_them(tmp_path):
    config = StereoDepthSensorConfig("D415").scaled(0.25)
    config.ir_distortion = config.ir_distortion_right = (0.1, 0.0, 0.0, 0.0, 0.0)
    config.max_disparity = 48
    width, height = config.ir_resolution
    one, frames = tmp_path / "one", tmp_path / "set" / "train_pbr" / "000000"
    for path in (*(one / f"ir_{side}.png" for side in SIDES), *(frames / f"ir_{side}" / "0.png" for side in SIDES)):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_gray(path, np.zeros((height, width), np.uint8))
    (one / "camera.json").write_text(json.dumps(cameras_json(config, np.eye(4))))
    write_head(tmp_path / "set", [], config, {})
    for folder in (one, frames):
        capture = pictures_capture(folder, StereoDepthSensorConfig("D435"))
        np.testing.assert_allclose(capture.rig.left.K, config.ir_intrinsic)
        assert tuple(capture.rig.right.distortion) == config.ir_distortion
        assert capture.rig.baseline_m == pytest.approx(config.focal_baseline_px_m / config.ir_intrinsic[0, 0])
        matcher = DepthModel(capture).parameters  # as in the sensor: what it refuses has no points here
        assert matcher.items() >= {"max_disparity": 48, "min_detection_sigma": config.min_detection_sigma}.items()
        assert matcher["noise_dn2_per_dn"] > 0 and "nominal" not in capture.name


def test_options_that_what_is_shown_does_not_take_are_refused(tmp_path, capsys):
    write_gray(tmp_path / "left.png", np.zeros((8, 8), np.uint8))
    (tmp_path / "model.json").write_text('{"format": "active-stereo-model", "version": 2}')
    for option, value, words in (
        ("--resolution", "64x48", "--resolution is for scene files"),
        ("--model", tmp_path / "model.json", "--model is for captures"),
        ("--sensor", "d415", "a capture has cameras of its own"),
    ):
        assert words in refused(("view", tmp_path, "--device", "cpu", option, value), capsys)
        if option == "--model":
            (tmp_path / "capture.json").write_text("{}")


def test_the_port_that_is_asked_for_is_taken_or_refused(server, tmp_path, capsys):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    args = make_parser().parse_args(["view", "--device", "cpu", "--port", str(port), str(tmp_path)])
    write_gray(tmp_path / "left.png", np.zeros((8, 8), np.uint8))
    with make_server(args, args.path) as own:
        assert f":{port}/" in own.address
    told = refused(("view", tmp_path, "--device", "cpu", "--port", server.server_port), capsys)
    assert f"--port {server.server_port}" in told
