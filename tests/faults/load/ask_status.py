"""Ask a daemon for its status fifty times a second; print how long each answer took, as JSON."""

from __future__ import annotations

import http.client
import json
import sys
import time

RATE_HZ = 50.0


def main(url: str, seconds: float) -> None:
    """Ask on a fixed schedule, so that a slow answer is not hidden by asking later.

    Parameters
    ----------
    url : str
        Of the daemon.
    seconds : float
        How long. [s]
    """
    connection = http.client.HTTPConnection(url.removeprefix("http://"), timeout=60)
    took_s = []
    began_s = time.perf_counter()
    for number in range(int(seconds * RATE_HZ)):
        due_s = began_s + number / RATE_HZ
        time.sleep(max(0.0, due_s - time.perf_counter()))
        asked_s = time.perf_counter()
        connection.request("GET", "/v1/status")
        answer = connection.getresponse()
        answer.read()
        assert answer.status == 200
        took_s.append(time.perf_counter() - asked_s)
    print(json.dumps({"took_s": took_s}))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
