"""The documentation page works on a machine without internet."""

from __future__ import annotations

import re


def test_the_page_loads_nothing_from_elsewhere(service):
    page = service.get("/docs")

    assert page.status_code == 200
    assert not re.search(r"(https?:)?//[a-z]", page.text)
    loaded = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert len(loaded) >= 3
    for path in loaded:
        assert service.get(path).status_code == 200, path
    assert "/openapi.json" in page.text


def test_swagger_ui_reads_the_version_that_we_write(service):
    assert service.get("/openapi.json").json()["openapi"].startswith("3.1")
    # Swagger UI reads OpenAPI 3.1 from its version 5 on
    assert re.search(r'"5\.\d+\.\d+"', service.get("/docs/swagger-ui-bundle.js").text)
