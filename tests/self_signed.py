"""A certificate of this machine that nobody else has signed."""

import subprocess


def self_signed(folder):
    """Paths of a certificate for 127.0.0.1 and of its key, made in a folder."""
    cert, key = str(folder / "cert.pem"), str(folder / "key.pem")
    command = [
        *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1"),
        *("-nodes", "-subj", "/CN=drone", "-addext", "subjectAltName=IP:127.0.0.1"),
        *("-keyout", key, "-out", cert),
    ]
    subprocess.run(command, check=True, capture_output=True)
    return cert, key
