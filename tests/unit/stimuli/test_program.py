import re

from webapp.stimuli.program import Program, running_program


def test_the_running_program_has_a_version_and_a_digest_that_do_not_change_while_it_runs() -> None:
    program = running_program()
    assert program.version
    assert re.fullmatch("[0-9a-f]{64}", program.digest)
    assert running_program() is program
    assert Program(**program.to_json()) == program
