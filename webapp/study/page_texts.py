"""The texts that pages ask for, whatever the study; a test compares them with templates and views."""

from collections.abc import Mapping

from webapp.study.texts import Wanted

_PLAIN = """
another_device.back another_device.secret another_device.text another_device.title
ask.also_missing ask.answer_title ask.at_goal ask.begin ask.begun_later ask.buttons ask.clear ask.errors.title
ask.explanation ask.from ask.from_start ask.go ask.in_use_title ask.lead ask.link ask.method ask.missing ask.no_steps
ask.none_offered ask.not_on_route ask.not_reached ask.nothing_missing ask.nothing_stored ask.on_route ask.passed_none
ask.passed_title ask.route ask.route_title ask.send ask.share ask.step_in_vain ask.step_unused ask.steps_title
ask.subgoals ask.title ask.undo ask.why_first ask.world_title ask.write ask.write_hint
attention.high attention.low
background.lead background.prefer_not_to_say background.send background.title
declined.back declined.text declined.title
full.text full.title
done.about_title done.close done.debriefing_title done.lead done.title
drive.buttons.forward drive.buttons.left drive.buttons.pickup drive.buttons.right drive.buttons.toggle
drive.did.forward drive.did.left drive.did.pickup drive.did.right drive.did.toggle drive.give_up drive.in_vain
drive.keys drive.label drive.lead_after drive.lead_before drive.lead_practice drive.skip drive.start drive.title_after
drive.title_before drive.title_practice
ended.text ended.title
error_pages.back error_pages.begin error_pages.busy error_pages.busy_title error_pages.failed error_pages.failed_title
error_pages.no_place error_pages.no_place_title error_pages.not_found error_pages.not_found_title error_pages.refused
error_pages.refused_title error_pages.study_changed error_pages.study_changed_title error_pages.too_large
errors.age_group errors.agree errors.title
explanation.action explanation.continue explanation.lead explanation.moments explanation.none explanation.placebic
explanation.ratings_lead explanation.ratings_title explanation.ratings_title_none explanation.send explanation.title
explanation.title_none
instructions.facts_title instructions.lead instructions.pictures_title instructions.start instructions.title
leave.another_device leave.answers leave.back leave.confirm leave.later leave.later_title leave.lead leave.title
left.text left.title
loading.failed
notices.already_answered notices.drive_failed notices.drive_gave_up notices.drive_reached notices.drive_step_limit
notices.language_unknown
notices.practice_over notices.quiz_failed notices.stale notices.too_early
page.error_prefix page.language_name page.languages page.leave page.notice_title page.offline page.progress
page.retrying page.sending page.skip page.test_banner
pictures_in_words.summary
player.back player.fast player.forward player.label player.normal player.pause player.play player.replay player.slow
player.speed player.start
probe.confidence probe.lead_elsewhere probe.lead_path probe.question probe.send probe.sure probe.title probe.unsure
quiz.again quiz.lead quiz.right quiz.send quiz.title
resume.confirm resume.over resume.text resume.title
satisfaction.lead satisfaction.title
situation.announced_lead situation.announced_title situation.continue situation.title_current situation.title_video
study.title
tailored.arrived tailored.missing tailored.nothing_missing
took_part.text took_part.title
way_back.code way_back.link way_back.title
welcome.age_title welcome.agree_guardian welcome.agree_title welcome.behaviour welcome.contact_title
welcome.data_title welcome.decline welcome.expect_title welcome.lead welcome.recruitment welcome.rights_title
welcome.start welcome.title
wrong_link.label wrong_link.prolific wrong_link.session wrong_link.sona wrong_link.text wrong_link.title
"""

_LISTS = """
done.about instructions.pictures satisfaction.items satisfaction.labels welcome.data welcome.expect welcome.rights
"""

_PLURALS = "ask.agent_steps ask.reached ask.unused drive.steps_left quiz.attempts_left"

_WITH_PARAMETERS = {
    "ask.errors.action": {"value"},
    "ask.errors.layout": {"value"},
    "ask.errors.step": {"last", "value"},
    "ask.errors.too_long": {"limit", "number"},
    "ask.from_later": {"step"},
    "ask.in_use": {"value"},
    "ask.world": {"number"},
    "attention.instruction": {"answer"},
    "done.contact": {"contact"},
    "errors.answer_invalid": {"legend"},
    "errors.answer_missing": {"legend"},
    "errors.answer_too_long": {"legend"},
    "errors.rating_invalid": {"legend"},
    "errors.rating_missing": {"legend"},
    "explanation.label": {"number"},
    "loading.progress": {"number", "total"},
    "page.step": {"number", "total"},
    "player.position": {"number", "total"},
    "probe.confidence_numbered": {"number"},
    "probe.number": {"number", "total"},
    "probe.question_numbered": {"number"},
    "welcome.adult": {"guardian_below"},
    "welcome.age": {"minimum_age"},
    "welcome.age_guardian": {"guardian_below", "minimum_age"},
    "welcome.agree": {"minimum_age"},
    "welcome.contact": {"contact"},
    "welcome.ethics_approval": {"ethics_approval"},
    "welcome.guardian": {"guardian_below", "minimum_age"},
    "welcome.retention": {"retention_until"},
    "wrong_link.invalid": {"name", "value", "wish"},
    "wrong_link.missing": {"name"},
}

PAGE_TEXTS: Mapping[str, Wanted] = {
    **{key: Wanted() for key in _PLAIN.split()},
    **{key: Wanted(is_list=True) for key in _LISTS.split()},
    **{key: Wanted(is_plural=True) for key in _PLURALS.split()},
    **{key: Wanted(parameters=frozenset(parameters)) for key, parameters in _WITH_PARAMETERS.items()},
}
"""What is needed, by full key."""
