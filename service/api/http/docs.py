"""`/docs`: Swagger UI, served from an installed package, so that it works without internet."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from fastapi import FastAPI, Request
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse
from starlette.responses import FileResponse

# fastapi-offline is asked for its copy of Swagger UI only; none of its code runs
_PACKAGE = "fastapi_offline"
# Swagger UI is started by a script inside the page and styles its elements; everything comes from here.
_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
_FILES = {
    "swagger-ui-bundle.js": "text/javascript",
    "swagger-ui.css": "text/css",
    "favicon.png": "image/png",
}


def install(app: FastAPI) -> None:
    """Add the page and the three files it loads."""
    found = importlib.util.find_spec(_PACKAGE)
    assert found is not None
    assert found.origin is not None
    folder = Path(found.origin).parent / "static"

    def serve(name: str, media_type: str) -> None:
        async def file() -> FileResponse:
            return FileResponse(folder / name, media_type=media_type, headers={"Cache-Control": "max-age=86400"})

        app.add_api_route(f"/docs/{name}", file, include_in_schema=False, response_model=None)

    for name, media_type in _FILES.items():
        serve(name, media_type)

    @app.get("/docs", include_in_schema=False)
    async def page(request: Request) -> HTMLResponse:
        root = request.scope.get("root_path", "")
        html = get_swagger_ui_html(
            openapi_url=f"{root}{app.openapi_url}",
            title=app.title,
            swagger_js_url=f"{root}/docs/swagger-ui-bundle.js",
            swagger_css_url=f"{root}/docs/swagger-ui.css",
            swagger_favicon_url=f"{root}/docs/favicon.png",
            # the badge of an outside validator would send our document there
            swagger_ui_parameters={"validatorUrl": "none", "displayRequestDuration": True},
        )
        html.headers["Content-Security-Policy"] = _POLICY
        return html
