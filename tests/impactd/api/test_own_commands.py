"""Commands in hints work as they are printed, whatever files the daemon was started with."""

from __future__ import annotations

from pathlib import Path

from impactd.api.own_commands import as_typed_here, own_options


def test_options_are_given_where_a_command_takes_them():
    """Absolute and quoted; commands that ask over HTTP stay as they are."""
    options = own_options(Path("/a b/rig.toml"), Path("/data"))
    assert options == "--config '/a b/rig.toml' --data /data"
    text = "Run `impactd token create --scope SCOPE` or `impactd doctor`, then `impactd status`."
    assert as_typed_here(text, options) == (
        f"Run `impactd token create --scope SCOPE {options}` or `impactd doctor {options}`, "
        "then `impactd status`."
    )
    assert as_typed_here(text, own_options(None, None)) == text


def test_a_missing_token_is_answered_with_the_command_of_this_daemon(rig, monkeypatch):
    """Problem and status say it; alarms, too."""
    monkeypatch.setattr(rig.daemon, "own_options", "--data /here")
    told = rig.anybody.get("/v1/shots").json()["remedy"]
    assert "`impactd token create --scope operate --name ME --data /here`" in told
    command = rig.anybody.get("/v1/status").json()["token_command"]
    assert command == "impactd token create --scope operate --name ME --data /here"
    rig.daemon.alarms.publish("rig.fault", {"detail": "It is gone.", "remedy": ""})
    alarm = rig.reader.get("/v1/alarms").json()["open"][0]
    rig.operator.post(f"/v1/alarms/{alarm['id']}/acknowledge")
    assert "`impactd doctor --data /here`" in alarm["guidance"][-1]
