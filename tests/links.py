"""What a live page gets: its files, and messages over its link."""

import asyncio
import json
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any


def get(url: str, **headers: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, b""


async def heard(url: str, act: Callable[[], object] = int, **headers: str) -> list[Any]:
    """The first message of a page's link, and what follows when something is done."""
    from tornado.httpclient import HTTPRequest
    from tornado.websocket import websocket_connect

    headers = {"Origin": "/".join(url.split("/")[:3]), **headers}
    page = await websocket_connect(
        HTTPRequest(url.replace("http:", "ws:") + "live", headers=headers)
    )
    first = json.loads(await asyncio.wait_for(page.read_message(), 10))
    act()
    page.close()
    messages = [first]
    while (text := await page.read_message()) is not None:
        messages.append(json.loads(text))
    return messages
