"""Odd questions to every route of the API, made up from its OpenAPI document."""

import pytest
from api_server import API, TOKEN, served
from hypothesis import HealthCheck, given, settings

from gaitchain.service.api import bare_app
from gaitchain.service.api_limits import ApiLimits

ROUTES = [
    (method.upper(), path)
    for path, methods in bare_app().openapi()["paths"].items()
    for method in methods
]
KINDS = ["positive", "negative"]
OFTEN = settings(
    max_examples=12,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


@pytest.fixture(scope="module")
def here():
    with served(ApiLimits(requests_per_s=1e6), shared=True) as server:
        yield server


@pytest.fixture(scope="module")
def document(here):
    import schemathesis  # half a second that only this module's tests take

    schema = schemathesis.openapi.from_dict(here.client.get("/openapi.json").json())
    schema.config.update(base_url=str(here.client.base_url))
    return schema


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_every_answer_is_as_documented(document, here, method, path, kind):
    from schemathesis import GenerationMode

    route = document[path][method]
    asked = []

    @OFTEN
    @given(case=route.as_strategy(generation_mode=GenerationMode(kind)))
    def ask(case):
        asked.append(case)
        case.call_and_validate(headers={"Authorization": f"Bearer {TOKEN}"})

    ask()
    assert asked


def test_the_server_is_as_it_was(here):
    assert here.client.get(f"{API}/state").status_code == 200
