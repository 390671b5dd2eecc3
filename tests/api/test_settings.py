"""Settings come from the environment, and a wrong one is told in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import model_store
from service.server import run_server
from service.settings import PREFIX, Settings, SettingsError, load_settings, require_tokens


@pytest.fixture(autouse=True)
def clean_environment(monkeypatch):
    for field in Settings.model_fields:
        monkeypatch.delenv(PREFIX + field.upper(), raising=False)


def test_the_defaults_are_safe_and_every_field_has_a_sentence():
    chosen = load_settings()

    assert (chosen.host, chosen.port) == ("127.0.0.1", 8000)
    assert Path(chosen.store_url) == Path(str(model_store.__file__)).parent
    assert all(str(field.description).endswith(".") for field in Settings.model_fields.values())


def test_an_argument_wins_over_the_environment(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_PORT", "9000")

    assert load_settings().port == 9000
    assert load_settings(port=None).port == 9000
    assert load_settings(port=9001).port == 9001


def test_an_empty_variable_counts_as_unset(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_PORT", "")

    assert load_settings().port == 8000


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("port", "abc", "0 to 65535"),
        ("port", "70000", "0 to 65535"),
        ("refresh_s", "nan", "more than 0 to 60"),
        ("refresh_s", "0", "more than 0 to 60"),
        ("log_level", "loud", "one of debug, info, warning, error"),
        ("log_format", "xml", "one of console, json"),
        ("default_model", "No Such", "name@version"),
        ("threads", "0", "1 to 1024"),
        ("max_points", "1", "2 to 10000000"),
        ("max_body_bytes", "x", "1024 to 1073741824"),
        ("keep_jobs_days", "0", "1 to 36500"),
        ("failed_logins_free", "0", "1 to 1000"),
    ],
)
def test_a_wrong_value_names_variable_value_and_range(monkeypatch, field, value, allowed):
    monkeypatch.setenv(PREFIX + field.upper(), value)

    with pytest.raises(SettingsError) as caught:
        load_settings()

    message = str(caught.value)
    assert PREFIX + field.upper() in message
    assert repr(value) in message
    assert allowed in message
    assert "\n" not in message


def test_what_kubernetes_injects_is_recognised(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_PORT", "tcp://10.0.0.1:8000")

    with pytest.raises(SettingsError, match="enableServiceLinks"):
        load_settings()


def test_an_unknown_setting_lists_the_known_ones():
    with pytest.raises(SettingsError, match=r"there is no setting prot; there are .*port"):
        load_settings(prot=1)


def test_an_unknown_variable_stops_the_start_with_the_nearest_name(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_PROT", "1")

    with pytest.raises(SettingsError, match=r"no setting ROVER_TWIN_PROT; the nearest is ROVER_TWIN_PORT"):
        load_settings()


def test_the_nearest_name_is_one_of_a_setting(monkeypatch):
    settings = {f"{PREFIX}{name.upper()}" for name in Settings.model_fields}
    for variable in ("ROVER_TWIN_", "ROVER_TWIN_TOKENS", "ROVER_TWIN_IMAGES", "ROVER_TWIN_URLS"):
        with monkeypatch.context() as patch:
            patch.setenv(variable, "1")
            with pytest.raises(SettingsError) as caught:
                load_settings()
        assert str(caught.value).rpartition(" ")[2] in settings


def test_origins_are_as_browsers_send_them(monkeypatch):
    origins = ["*", "https://a.example", "http://localhost:3000", "http://[::1]:8080"]
    monkeypatch.setenv("ROVER_TWIN_CORS_ORIGINS", json.dumps(origins))

    assert load_settings().cors_origins == tuple(origins)


@pytest.mark.parametrize("origin", ["notanorigin", "https://a.example/", "HTTPS://B.example", "https://", "", "null"])
def test_what_no_browser_sends_is_no_origin(monkeypatch, origin):
    monkeypatch.setenv("ROVER_TWIN_CORS_ORIGINS", json.dumps(["https://a.example", origin]))

    with pytest.raises(SettingsError, match=r"ROVER_TWIN_CORS_ORIGINS is .* a JSON list of origins") as caught:
        load_settings()
    assert "\n" not in str(caught.value)


def test_a_database_of_another_kind_is_told_which_there_are(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_JOBS_DATABASE_URL", "mysql://user:password@host/jobs")

    with pytest.raises(SettingsError, match="sqlite:///FILE or postgresql://") as caught:
        load_settings()
    assert "password" not in str(caught.value)


def test_what_kubernetes_injects_beside_is_recognised(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_SERVICE_HOST", "10.0.0.1")

    with pytest.raises(SettingsError, match="enableServiceLinks"):
        load_settings()


@pytest.mark.parametrize("field", ["admin_token", "jobs_database_url"])
def test_a_refused_secret_is_not_printed(monkeypatch, field):
    monkeypatch.setenv(PREFIX + field.upper(), "secret-word")

    with pytest.raises(SettingsError) as caught:
        load_settings()
    assert "secret-word" not in str(caught.value)
    assert PREFIX + field.upper() in str(caught.value)


def test_a_secret_may_be_in_a_file(monkeypatch, tmp_path):
    (tmp_path / "token").write_text("a token of more than sixteen letters\n")
    monkeypatch.setenv("ROVER_TWIN_ADMIN_TOKEN_FILE", str(tmp_path / "token"))

    assert load_settings().admin_token.get_secret_value() == "a token of more than sixteen letters"
    monkeypatch.setenv("ROVER_TWIN_ADMIN_TOKEN", "another token of enough letters")
    with pytest.raises(SettingsError, match="both"):
        load_settings()


def test_a_file_that_is_not_there_is_named_by_its_variable(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_ADMIN_TOKEN_FILE", "/nowhere/token")

    with pytest.raises(SettingsError, match="ROVER_TWIN_ADMIN_TOKEN_FILE"):
        load_settings()


def test_a_token_for_everything_needs_tokens(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_REQUIRE_TOKEN", "true")

    with pytest.raises(SettingsError, match="ROVER_TWIN_TOKENS_FILE"):
        run_server(load_settings())
    monkeypatch.setenv("ROVER_TWIN_TOKENS_FILE", "/run/secrets/tokens")
    require_tokens(load_settings())


@pytest.mark.parametrize("said", ['["proxy.example"]', '["10.0.0.1/8"]', "10.0.0.1", "[1]"])
def test_proxies_are_addresses_and_networks(monkeypatch, said):
    monkeypatch.setenv("ROVER_TWIN_TRUSTED_PROXIES", said)

    with pytest.raises(SettingsError, match="ROVER_TWIN_TRUSTED_PROXIES") as caught:
        load_settings()
    assert "\n" not in str(caught.value)


def test_proxies_are_a_list(monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_TRUSTED_PROXIES", '["10.0.0.0/8", "2001:db8::/32"]')

    assert load_settings().trusted_proxies == ("10.0.0.0/8", "2001:db8::/32")
