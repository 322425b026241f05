"""Answer every request with the same few bytes: what this host itself costs, beside the daemon."""

from __future__ import annotations

from http.server import BaseHTTPRequestHandler, HTTPServer

ANSWER = b'{"ready": true}'


class _Bare(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        """Answer at once."""
        self.send_response(200)
        self.send_header("Content-Length", str(len(ANSWER)))
        self.end_headers()
        self.wfile.write(ANSWER)

    def log_message(self, *_: object) -> None:
        """Stay quiet."""


if __name__ == "__main__":
    server = HTTPServer(("127.0.0.1", 0), _Bare)
    print(f"http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()
