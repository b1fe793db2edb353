"""The texts that pages ask for, whatever the study; a test compares them with templates and views."""

from collections.abc import Mapping

from webapp.study.texts import Wanted

_PLAIN = """
study.title
page.skip page.test_banner page.error_prefix page.notice_title page.progress page.leave page.sending
notices.already_answered notices.too_early notices.stale
welcome.title welcome.lead welcome.expect_title welcome.rights_title welcome.data_title welcome.contact_title
welcome.agree_title welcome.agree welcome.start welcome.decline
declined.title declined.text declined.back
instructions.title instructions.lead instructions.facts_title instructions.pictures_title instructions.start
situation.title_current situation.title_video situation.announced_title situation.announced_lead situation.continue
player.label player.start player.play player.pause player.replay player.back player.forward player.speed player.slow
player.normal player.fast
explanation.title explanation.lead explanation.moments explanation.action explanation.ratings_title
explanation.ratings_lead explanation.send
errors.title errors.agree
leave.title leave.lead leave.answers leave.confirm leave.back
left.title left.text
done.title done.lead done.about_title done.close
error_pages.back error_pages.not_found_title error_pages.not_found error_pages.refused_title error_pages.refused
error_pages.too_large error_pages.failed_title error_pages.failed error_pages.no_place_title error_pages.no_place
error_pages.study_changed_title error_pages.study_changed error_pages.busy_title error_pages.busy error_pages.begin
"""

_LISTS = "welcome.expect welcome.rights welcome.data instructions.pictures done.about"

_WITH_PARAMETERS = {
    "page.step": {"number", "total"},
    "welcome.retention": {"retention_until"},
    "welcome.contact": {"contact"},
    "welcome.ethics_approval": {"ethics_approval"},
    "player.position": {"number", "total"},
    "explanation.label": {"number"},
    "errors.rating_missing": {"legend"},
    "errors.rating_invalid": {"legend"},
    "done.contact": {"contact"},
}

PAGE_TEXTS: Mapping[str, Wanted] = {
    **{key: Wanted() for key in _PLAIN.split()},
    **{key: Wanted(is_list=True) for key in _LISTS.split()},
    **{key: Wanted(parameters=frozenset(parameters)) for key, parameters in _WITH_PARAMETERS.items()},
}
"""What is needed, by full key."""
