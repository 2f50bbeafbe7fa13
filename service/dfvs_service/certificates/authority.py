"""Certificate authority, and the certificates that it signs, as PEM files."""

from __future__ import annotations

import datetime
import ipaddress
import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from dfvs_core.errors import ConfigError

_CLOCK_SLACK = datetime.timedelta(hours=1)
_HOST = re.compile(r"[\w.*-]+", re.ASCII)


@dataclass(frozen=True, slots=True)
class Credentials:
    """A certificate with its private key."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


@dataclass(frozen=True, slots=True)
class Validity:
    """From when to when certificates are good."""

    begin: datetime.datetime
    end: datetime.datetime

    @classmethod
    def days_from_now(cls, days: int) -> Validity:
        """Good for so many days, and a little before now for clocks that are behind."""
        now = datetime.datetime.now(datetime.UTC)
        return cls(now - _CLOCK_SLACK, now + datetime.timedelta(days=days))

    def within(self, certificate: x509.Certificate) -> Validity:
        """Good for no longer than a certificate is."""
        return Validity(self.begin, min(self.end, certificate.not_valid_after_utc))


def make_authority(validity: Validity) -> Credentials:
    """Authority that signs the roles' certificates, and nothing below them."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "DFVS authority")])
    usage = x509.KeyUsage(
        key_cert_sign=True,
        crl_sign=True,
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )
    certificate = (
        _builder(subject, subject, key, validity)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .sign(key, hashes.SHA256())
    )
    return Credentials(certificate, key)


def make_certificate(
    authority: Credentials, name: str, hosts: tuple[str, ...], validity: Validity
) -> Credentials:
    """Certificate of a role; ``hosts`` are the names and addresses at which it listens."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    usages = [ExtendedKeyUsageOID.CLIENT_AUTH]
    if hosts:
        usages.append(ExtendedKeyUsageOID.SERVER_AUTH)
    builder = (
        _builder(subject, authority.certificate.subject, key, validity)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.key.public_key()),
            critical=False,
        )
    )
    names = [x509.DNSName(name), *(host_name(host) for host in hosts)]
    builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
    return Credentials(builder.sign(authority.key, hashes.SHA256()), key)


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, validity: Validity
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(validity.begin)
        .not_valid_after(validity.end)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def host_name(text: str) -> x509.GeneralName:
    """Name or address of a machine, as certificates hold it.

    Raises
    ------
    ConfigError
        If it is neither.
    """
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        if _HOST.fullmatch(text):
            return x509.DNSName(text)
    expected = "an address, or a name in ASCII (xn--… for another one), without port"
    raise ConfigError(f"--host {text!r}", expected)


def write_new(path: Path, data: bytes, mode: int) -> None:
    """Write a file that is not there yet, with its final permissions from the first byte on."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)


def write_credentials(folder: Path, credentials: Credentials, authority: Credentials) -> None:
    """Write ``certificate.pem``, ``key.pem`` (0600) and ``ca.pem`` into a new private folder.

    The folder is there once it is whole.
    """
    partial = folder.with_name(folder.name + ".part")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(mode=0o700)
    write_new(partial / "certificate.pem", _pem(credentials.certificate), 0o644)
    write_new(partial / "key.pem", _key_pem(credentials.key), 0o600)
    write_new(partial / "ca.pem", _pem(authority.certificate), 0o644)
    partial.rename(folder)


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(serialization.Encoding.PEM)


def _key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def read_certificate(path: Path) -> x509.Certificate:
    """Certificate of a PEM file.

    Raises
    ------
    ConfigError
        If it cannot be read.
    """
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} holds no certificate ({error})") from error


def has_expired(certificate: x509.Certificate) -> bool:
    """Whether a certificate is no longer good."""
    return certificate.not_valid_after_utc <= datetime.datetime.now(datetime.UTC)


def is_for_host(certificate: x509.Certificate, host: str) -> bool:
    """Whether a certificate names a machine; see :func:`host_name`."""
    return any(
        isinstance(extension.value, x509.SubjectAlternativeName)
        and host_name(host) in extension.value
        for extension in certificate.extensions
    )


def read_authority(folder: Path) -> Credentials:
    """Authority that an earlier run made.

    Raises
    ------
    ConfigError
        If it cannot be read, or has expired.
    """
    certificate = read_certificate(folder / "certificate.pem")
    if has_expired(certificate):
        raise ConfigError(
            f"the authority in {folder} expired on {certificate.not_valid_after_utc:%Y-%m-%d}",
            "one that is valid",
            "make a new one, with certificates for all roles, in another folder",
        )
    try:
        key = serialization.load_pem_private_key((folder / "key.pem").read_bytes(), None)
    except (OSError, ValueError, TypeError) as error:  # TypeError: it has a passphrase
        raise ConfigError(f"{folder} holds no authority ({error})") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ConfigError(f"{folder / 'key.pem'} is not an elliptic-curve key")
    return Credentials(certificate, key)
