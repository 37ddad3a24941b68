"""Builds an SPDX 2.3 document: packages, relationships, licences that are not in SPDX's list."""
import datetime
import hashlib
import json
import re
import urllib.parse


def identifier(*words):
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.]+", "-", "-".join(words).replace("+", "p")).strip("-")


def purl(kind, name, version, **more):
    tail = "?" + urllib.parse.urlencode(more) if more else ""
    return f"pkg:{kind}/{urllib.parse.quote(name, safe='/')}@{urllib.parse.quote(version, safe='')}{tail}"


class Document:
    """Everything is sorted when it is written, so the same content gives the same bytes, whatever the order of insertion."""

    def __init__(self, name, version, epoch):
        self.name, self.version, self.epoch = name, version, epoch
        self.packages, self.relationships, self.licences = {}, set(), {}
        self.comments = {}

    def add(self, spdx_id, name, version, *, declared=None, concluded=None, supplier="NOASSERTION", purl=None, **more):
        package = {
            "SPDXID": spdx_id, "name": name, "versionInfo": version, "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
            "supplier": supplier, "licenseDeclared": declared or "NOASSERTION", "licenseConcluded": concluded or "NOASSERTION",
            "copyrightText": "NOASSERTION", **{key: value for key, value in more.items() if value},
        }
        if purl:
            package["externalRefs"] = [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": purl}]
        self.packages[spdx_id] = package
        return spdx_id

    def relate(self, one, kind, other, comment=""):
        self.relationships.add((one, kind, other))
        if comment:
            self.comments[one, kind, other] = comment

    def text(self):
        related = []
        for key in sorted(self.relationships):
            entry = dict(zip(("spdxElementId", "relationshipType", "relatedSpdxElement"), key))
            if key in self.comments:
                entry["comment"] = self.comments[key]
            related.append(entry)
        document = {
            "spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": f"{self.name}-{self.version}",
            "creationInfo": {
                "created": datetime.datetime.fromtimestamp(self.epoch, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
                "creators": ["Tool: voxeld-tools-sbom"], "licenseListVersion": "3.20",
            },
            "packages": [self.packages[key] for key in sorted(self.packages)],
            "relationships": related,
            "hasExtractedLicensingInfos": [{"licenseId": key, "name": key, "extractedText": text}
                                           for key, text in sorted(self.licences.items())],
        }
        # A unique name for each content.
        digest = hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()[:32]
        document["documentNamespace"] = f"https://voxeld.invalid/spdx/{self.name}-{self.version}-{digest}"
        return json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
