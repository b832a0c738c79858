"""The server: who is let in, what is served, and what two windows see of each other."""

import json
import shutil
import time
from urllib.parse import quote

import pytest
from serving import TOKEN, Served
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from facesynth.corpus.journal import Journal
from facesynth.inference.errors import FacesynthError
from facesynth.speech.alignment import Alignment
from facesynth.speech.audio import save_wav
from facesynth.studio.app import three_js
from facesynth.studio.guard import LARGEST_UPLOAD_BYTES
from facesynth.studio.serve import serve


@pytest.fixture(scope="module")
def served(tmp_path_factory, tiny):
    folder = tmp_path_factory.mktemp("served")
    shutil.copytree(tiny.path, folder / "corpus")
    served = Served(folder, folder / "corpus")
    yield served
    served.close()


def told(window, kind, **wanted):
    """The next message of a kind."""
    while True:
        message = json.loads(window.recv(timeout=20))
        if message["kind"] == kind and all(message.get(name) == value for name, value in wanted.items()):
            return message


def asked(window, op, number=1, **facts):
    window.send(json.dumps({"op": op, "id": number, **facts}))
    return told(window, "answer", id=number)


def test_the_first_address_gives_a_cookie_and_the_page_follows(served):
    status, _, headers = served.ask(f"/?token={TOKEN}", cookie=None, origin=None)
    assert status == 303
    assert headers["location"] == "/"
    assert "HttpOnly" in headers["set-cookie"]
    assert "SameSite=Strict" in headers["set-cookie"]
    status, page, headers = served.ask("/", origin=None)
    assert status == 200
    assert "facesynth studio" in page
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "http" not in headers["content-security-policy"]


@pytest.mark.parametrize(
    ("headers", "said"),
    [
        ({"cookie": None}, "token is wrong or missing"),
        ({"cookie": "facesynth-{port}=wrong"}, "token is wrong or missing"),
        ({"host": "studio.example.com:{port}"}, "got the host 'studio.example.com"),
        ({"host": "127.0.0.1:1"}, "got the host"),
        ({"origin": "http://example.com"}, "another page may not use the studio"),
        ({"origin": "null"}, "another page may not use the studio"),
    ],
)
@pytest.mark.parametrize("path", ["/", "/sound/hello", "/head.glb", "/upload"])
def test_strangers_get_one_line(served, headers, said, path):
    filled = {name: value and value.format(port=served.port) for name, value in headers.items()}
    status, text, _ = served.ask(path, **filled)
    assert status == 403
    assert said in text
    assert text.count("\n") == 1


def test_a_window_needs_the_token_and_the_studios_own_page(served):
    for headers, origin in (({"Cookie": "a=b"}, f"http://{served.host}"), ({}, "http://example.com")):
        given = {"Cookie": f"facesynth-{served.port}={TOKEN}", **headers}
        with (
            pytest.raises((InvalidStatus, ConnectionClosed)),
            connect(f"ws://{served.host}/link", origin=origin, additional_headers=given) as window,
        ):
            window.recv(timeout=10)


@pytest.mark.parametrize(
    "path",
    [
        "/page/../app.py",
        "/page/%2e%2e%2fapp.py",
        "/page/..%5capp.py",
        "/sound/..%2f..%2fproject",
        "/sound/%2fetc%2fpasswd",
        "/recorded/..%2fcorpus",
        "/exports/..%2fjournal.jsonl",
        "/exports/%00",
        "/exports/journal.jsonl",
        "/reports/..",
        "/reports/..%2f..",
        "/reports/lines",
        "//etc/passwd",
        "/project.json",
    ],
)
def test_no_path_leads_out(served, path):
    status, text, _ = served.ask(path)
    assert status == 404
    assert "root:" not in text


def test_a_report_is_a_page_that_may_do_nothing(served):
    page = served.project.folder / "reports" / "ridge-1" / "index.html"
    page.parent.mkdir(parents=True)
    page.write_text("<title>report</title>")
    with served.window() as window:
        assert told(window, "all")["reports"] == ["ridge-1"]
    status, text, headers = served.ask("/reports/ridge-1")
    assert (status, text) == (200, "<title>report</title>")
    assert headers["content-security-policy"].startswith("sandbox; default-src 'none'")


def test_an_upload_of_two_gigabytes_is_refused_before_it_comes(served):
    start = time.perf_counter()
    status, text, _ = served.ask("/upload?name=long.wav", "POST", b"RIFF", content_length=str(2 * 2**31))
    assert status == 413
    assert f"{LARGEST_UPLOAD_BYTES // 2**20} MB at most" in text
    assert time.perf_counter() - start < 10


def test_an_upload_that_hides_its_length_is_cut_off(served, monkeypatch):
    monkeypatch.setattr("facesynth.studio.guard.LARGEST_UPLOAD_BYTES", 1000)
    chunk = b"400\r\n" + b"x" * 1024 + b"\r\n"
    status, text, _ = served.ask(
        "/upload?name=long.wav", "POST", 2 * chunk + b"0\r\n\r\n", transfer_encoding="chunked", content_length=None
    )
    assert (status, "too large" in text) == (413, True)
    assert not [path for path in served.project.folder.iterdir() if path.name.startswith(".upload")]


@pytest.mark.parametrize(
    ("name", "body", "said"),
    [
        ("a.wav", b"nonsense", "a.wav"),
        ("a.wav", b"", "empty"),
        ("..", b"x", "utterance id"),
        ("con.wav", b"x", "device on Windows"),
    ],
)
def test_an_upload_that_is_no_sound_is_one_line(served, name, body, said):
    status, text, _ = served.ask(f"/upload?name={quote(name)}", "POST", body)
    assert status == 422
    assert said in json.loads(text)["error"]
    assert str(served.project.folder) not in text
    assert "\n" not in text


def test_an_upload_becomes_a_line_in_every_window(served, tiny, tmp_path, monkeypatch):
    speech = tiny[tiny.ids[0]].speech
    placed = Alignment(speech.phones, (("ba", 0.2, 0.4),), ("sounded out by rule",), -45.0)
    monkeypatch.setattr("facesynth.speech.phone_sources.align", lambda *_: placed)
    save_wav(tmp_path / "línea.wav", speech.audio, speech.sample_rate)
    body = (tmp_path / "línea.wav").read_bytes()
    with served.window() as window:
        told(window, "all")
        status, text, _ = served.ask(f"/upload?name={quote('línea.wav')}&text=ba", "POST", body)
        assert (status, json.loads(text)) == (200, {"line": "línea"})
        message = told(window, "project")
        assert told(window, "note")["lines"] == ["sounded out by rule"]
    assert "línea" in message["order"]
    assert message["lines"][0]["takes"][0]["words"] == [["ba", 0.2, 0.4]]
    status, _, headers = served.ask(f"/sound/{quote('línea')}")
    assert (status, headers["content-type"]) == (200, "audio/wav")


def test_two_windows_see_what_the_other_does_and_do_not_overwrite_it(served):
    with served.window() as one, served.window() as two:
        revision = told(one, "all")["project"]["revision"]
        told(two, "all")
        relabel = {"do": "relabel", "base": revision}
        what = {"line": "hello", "take": "1", "phone": 2}
        assert asked(one, "change", 1, **relabel, **{"with": {**what, "label": "aa"}})["ok"]
        seen = told(two, "project")
        assert seen["lines"][0]["takes"][0]["phones"][2][0] == "aa"
        late = asked(two, "change", 2, **relabel, **{"with": {**what, "label": "m"}})
        assert not late["ok"]
        assert "another window changed this" in late["error"]
        again = asked(two, "change", 3, do="relabel", base=seen["revision"], **{"with": {**what, "label": "m"}})
        assert again["ok"]
        assert told(one, "project", revision=again["revision"])["lines"][0]["takes"][0]["phones"][2][0] == "m"


@pytest.mark.parametrize(
    "text", ["nonsense", "[]", '{"op": 3}', '{"op": "__init__"}', '{"op": "change"}', '{"op": "export", "line": 1}']
)
def test_a_message_that_is_none_is_answered_in_one_line(served, text):
    with served.window() as window:
        told(window, "all")
        window.send(text)
        answer = told(window, "answer")
    assert not answer["ok"]
    assert "\n" not in answer["error"]


def test_a_corpus_that_changed_on_disk_is_told(served):
    with served.window() as window:
        told(window, "all")
        corpus = served.project.folder.parent / "corpus"
        Journal(corpus / "edits.jsonl").remove("s00_neutral_t1:1")
        assert "edits.jsonl" in told(window, "corpus")["changed"]


def test_what_cannot_be_served_is_told_before(tmp_path, tiny, monkeypatch):
    def opened(_address):
        raise AssertionError

    with pytest.raises(FacesynthError, match=r"no\.safetensors"):
        serve(tmp_path / "p", tiny.path, tmp_path / "no.safetensors", opened=opened)
    with pytest.raises(FacesynthError, match="is no project yet; give the corpus"):
        serve(tmp_path / "p", None, None, opened=opened)
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(FacesynthError, match=r"facesynth\[studio\]"):
        three_js()
