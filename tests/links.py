"""What a live page gets: its files, and messages over its link."""

import asyncio
import json
import urllib.error
import urllib.request
from typing import Any


def get(url: str, **headers: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, b""


async def first_message(url: str) -> Any:
    """What a page is told as soon as it has a link."""
    from tornado.httpclient import HTTPRequest
    from tornado.websocket import websocket_connect

    headers = {"Origin": "/".join(url.split("/")[:3])}
    asked = HTTPRequest(url.replace("http:", "ws:") + "live", headers=headers)
    page = await websocket_connect(asked)
    found = json.loads(await asyncio.wait_for(page.read_message(), 10))
    page.close()
    return found
