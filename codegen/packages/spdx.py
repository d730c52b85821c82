"""SPDX: a bill of materials of the C, each file with its checksums (SPDX 2.3 as JSON)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping

from firmloop.codegen.delivery import VERSION, Delivery

_CREATED = "1970-01-01T00:00:00Z"  # the format wants a date; the same project gives the same bytes on any day
_NAMED_BY = "https://spdx.org/spdxdocs"


def spdx(delivery: Delivery) -> Mapping[str, str]:
    """Return `<name>.spdx.json`; SPDX asks for SHA-1."""
    name, files = delivery.program.name, sorted(delivery.bundle.files.items())
    sums = [hashlib.sha1(text.encode()).hexdigest() for _, text in files]
    entries = [_entry(k, file, text) for k, (file, text) in enumerate(files)]
    whole = hashlib.sha1("".join(sorted(sums)).encode()).hexdigest()
    package = {
        "SPDXID": "SPDXRef-Package",
        "name": name,
        "versionInfo": VERSION,
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": True,
        "packageVerificationCode": {"packageVerificationCodeValue": whole},
        "licenseConcluded": "NOASSERTION",
        "licenseDeclared": "NOASSERTION",
        "licenseInfoFromFiles": ["NOASSERTION"],
        "copyrightText": "NOASSERTION",
        "comment": f"program {delivery.program.id}; {delivery.command} makes it again",
    }
    document = {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": name,
        "documentNamespace": f"{_NAMED_BY}/{name}-{delivery.program.id}",
        "creationInfo": {"created": _CREATED, "creators": ["Tool: firmloop"]},
        "documentDescribes": ["SPDXRef-Package"],
        "packages": [{**package, "hasFiles": [entry["SPDXID"] for entry in entries]}],
        "files": entries,
    }
    return {f"{name}.spdx.json": json.dumps(document, indent=1) + "\n"}


def _entry(number: int, file: str, text: str) -> dict[str, object]:
    content = text.encode()
    return {
        "SPDXID": f"SPDXRef-File-{number}",
        "fileName": f"./src/{file}",
        "fileTypes": ["SOURCE"],
        "checksums": [
            {"algorithm": "SHA1", "checksumValue": hashlib.sha1(content).hexdigest()},
            {"algorithm": "SHA256", "checksumValue": hashlib.sha256(content).hexdigest()},
        ],
        "licenseConcluded": "NOASSERTION",
        "licenseInfoInFiles": ["NOASSERTION"],
        "copyrightText": "NOASSERTION",
    }


FILES = spdx
