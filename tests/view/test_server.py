"""The server: on this machine only, for who has the token, and for one tab."""

import asyncio
import json
import subprocess
import sys
import urllib.error
import urllib.parse
import urllib.request

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from selfmotion.basics import RenderError
from selfmotion.shell.view import application, check_server, listening
from support.views import CIRCLE, TOKEN, served, told


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    file = tmp_path_factory.mktemp("view") / "circle.toml"
    file.write_text(CIRCLE)
    with served(file) as found:
        yield found


def answer(server, path, host=None, **headers):
    """Return status, headers and text of a request."""
    asked = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", headers=headers)
    asked.add_header("Host", host or f"127.0.0.1:{server.port}")
    try:
        with urllib.request.urlopen(asked, timeout=60) as found:
            return found.status, dict(found.headers), found.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, dict(error.headers), error.read().decode()


def test_the_page_is_for_who_has_the_token(server):
    status, headers, text = answer(server, f"/?token={TOKEN}")
    assert status == 200
    assert "connect-src 'self'" in text
    assert headers["cache-control"] == "no-store"
    assert headers["referrer-policy"] == "no-referrer"
    for path in ("/", "/?token=", f"/?token={TOKEN[:-1]}", "/?token=%C3%A9", "/export?as=.csv"):
        status, _, text = answer(server, path)
        assert status == 403, path
        assert "token is missing or wrong" in text


@pytest.mark.parametrize(
    ("host", "origin"),
    [("evil.example:80", None), ("127.0.0.1", None), (None, "http://evil.example"), (None, "null")],
)
def test_a_foreign_page_gets_nothing(server, host, origin):
    headers = {} if origin is None else {"Origin": origin}
    status, _, text = answer(server, f"/?token={TOKEN}", host, **headers)
    assert status == 403
    assert text.startswith("refused: ")
    assert len(text) < 200


@pytest.mark.parametrize(("port", "status"), [(80, 200), (8080, 403)])
def test_browsers_leave_out_the_port_of_http(server, port, status):
    app = application(server.session, TOKEN, port)
    found = []

    async def send(message):
        found.append(message)

    headers = [(b"host", b"127.0.0.1"), (b"origin", b"http://127.0.0.1")]
    query = f"token={TOKEN}".encode()
    scope = {"type": "http", "method": "GET", "path": "/", "query_string": query}
    asyncio.run(app({**scope, "headers": headers}, None, send))
    assert found[0]["status"] == status


def test_it_listens_on_this_machine_only():
    bound = listening(0)
    assert bound.getsockname()[0] == "127.0.0.1"
    bound.close()


def live(server, token=TOKEN, **options):
    return connect(
        f"ws://127.0.0.1:{server.port}/live?token={token}", max_size=None, proxy=None, **options
    )


def test_the_connection_is_for_who_has_the_token_and_for_one_tab(server):
    with live(server, "wrong") as refused:
        with pytest.raises(ConnectionClosed):
            refused.recv(60)
        assert refused.close_code == 4403
    with live(server, origin="http://evil.example") as refused:
        with pytest.raises(ConnectionClosed):
            refused.recv(60)
        assert refused.close_code == 4403
    with live(server) as first:
        assert told(first.recv(60))["kind"] == "whole"
        with live(server) as second:
            with pytest.raises(ConnectionClosed):
                second.recv(60)
            assert second.close_code == 4409
            assert second.close_reason == "another tab has this page"
        first.send(json.dumps({"do": "shout"}))
        assert "expected drag" in json.loads(first.recv(60))["error"]
    # When it is closed another one may come.
    for _ in range(100):
        with live(server) as third:
            try:
                assert told(third.recv(60))["kind"] == "whole"
                break
            except ConnectionClosed:
                continue
    else:
        pytest.fail("the page is still taken")


def test_what_is_no_json_is_answered_and_the_connection_stays(server):
    with live(server) as page:
        page.recv(60)
        not_a_number = '{"do": "slide", "name": "duration", "value": NaN}'
        for text in ("{", "[]", "5", "[" * 60_000, not_a_number):
            page.send(text)
            assert "error" in json.loads(page.recv(60))
        page.send(json.dumps({"do": "save"}))
        assert json.loads(page.recv(60))["saved"]
    assert server.session.edited.file.read_text() == CIRCLE


def test_files_are_exported(server):
    status, headers, text = answer(server, f"/export?token={TOKEN}&as=.csv")
    assert status == 200
    assert headers["content-disposition"] == "attachment; filename*=UTF-8''circle.csv"
    assert text.startswith("t,")
    status, _, text = answer(server, f"/export?token={TOKEN}&as=.exe")
    assert status == 409
    assert "expected one of" in text


def test_a_plan_beside_is_for_who_has_the_token(server):
    address = f"http://127.0.0.1:{server.port}/beside?name=a.npz"
    for token, origin, status in (
        ("", None, 403),
        (TOKEN, "http://evil.example", 403),
        (TOKEN, None, 409),
    ):
        asked = urllib.request.Request(f"{address}&token={token}", data=b"no plan")
        if origin:
            asked.add_header("Origin", origin)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(asked, timeout=60)
        assert refused.value.code == status
    assert refused.value.read().decode().startswith("a.npz: ")


def test_a_port_that_is_taken_is_told():
    bound = listening(0)
    bound.listen()
    with pytest.raises(RenderError, match=r"port \d+ is taken"):
        listening(bound.getsockname()[1])
    bound.close()


def test_what_is_missing_is_told_and_how_to_get_it(monkeypatch):
    check_server()
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with pytest.raises(RenderError, match=r"uvicorn: pip install 'selfmotion\[view\]'"):
        check_server()


def test_nobody_else_imports_the_server():
    names = ("starlette", "uvicorn", "websockets", "tomlkit", "anyio")
    code = (
        "import sys, selfmotion, selfmotion.replay, selfmotion.shell.cli; "
        f"print([name for name in {names} if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_files_with_any_name_are_exported(tmp_path):
    file = tmp_path / 'löten "日本".toml'
    file.write_text(CIRCLE)
    with served(file) as named:
        status, headers, _ = answer(named, f"/export?token={TOKEN}&as=.csv")
    assert status == 200
    name = headers["content-disposition"].removeprefix("attachment; filename*=UTF-8''")
    assert urllib.parse.unquote(name) == 'löten "日本".csv'
