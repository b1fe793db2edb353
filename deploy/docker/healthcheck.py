"""Ask the server in this container whether it can do its work: exit status 0 if it says so, 1 if not.

Needs the standard library alone, because the image has no curl.
"""

import http.client
import os
import sys

_PATIENCE_S = 4.0


def main() -> int:
    """Ask `/healthz` under the first name that the server listens to."""
    port = int(os.environ.get("XAR_PORT", "8000"))
    name = os.environ.get("XAR_TRUSTED_HOSTS", "").split(",")[0].strip() or f"127.0.0.1:{port}"
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_PATIENCE_S)
    try:
        connection.request("GET", "/healthz", headers={"Host": name})
        status = connection.getresponse().status
    except (OSError, http.client.HTTPException) as error:
        print(f"no answer from port {port}: {error}", file=sys.stderr)
        return 1
    finally:
        connection.close()
    if status != http.HTTPStatus.OK:
        print(f"/healthz was answered with {status}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
