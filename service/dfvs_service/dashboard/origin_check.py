"""Origin-check middleware (ASGI): Host, Origin, and security headers of answers.

A page on the internet can make a browser talk to 127.0.0.1, by its address or by a name that it
lets point there (DNS rebinding). So only known names are served, WebSockets are opened for our own
page alone, and our page may load from and talk to nobody else.
"""

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dfvs_service.dashboard.address import PublicAddress

_HEADERS = {
    # Everything from ourselves, nothing from elsewhere.
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class OriginCheckMiddleware:
    """Refuses requests for other hosts and from other origins; adds headers to every answer."""

    def __init__(self, app: ASGIApp, address: PublicAddress) -> None:
        self._app = app
        self._address = address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if (refusal := self._refusal(scope)) is None:
            await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": refusal})
        else:
            answer = PlainTextResponse(refusal, status_code=403)
            await answer(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> str | None:
        """Why a request is not served, or None."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not self._address.is_served(hosts[0]):
            return "this host name is not served here; see dfvs-dashboard --name"
        origins = headers.getlist("origin")
        is_ours = len(origins) == 1 and self._address.is_own_origin(origins[0], hosts[0])
        if scope["type"] == "websocket":
            return None if is_ours else "only this page may open a connection here"
        if scope["method"] not in ("GET", "HEAD"):
            return "the page is only read; commands go through its connection"
        return None if is_ours or not origins else "only this page may ask here"


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(_HEADERS)
        await send(message)

    return send_with_headers
