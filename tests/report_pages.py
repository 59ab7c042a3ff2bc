"""Reports as their readers meet them."""

from __future__ import annotations

import base64
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree


class Page(HTMLParser):
    """What a report shows and what it refers to.

    Attributes:
        tags: all that stand in it.
        references: to anything but the images.
        images: their sources.
        text: all that is read.
        headings: of the first and second level, in order.
        words: text under each heading.
        pictures: what each image shows, under each heading.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags, self.references, self.images = set(), [], []
        self.headings, self.words, self.pictures = [], [], []
        self._heading, self._shown = False, []
        self.feed(path.read_text(encoding='utf-8'))
        self.text = ' '.join(' '.join(self._shown).split())

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        for name, value in attrs:
            if tag == 'img' and name == 'src':
                self.images.append(value)
            elif name in ('src', 'href', 'srcset', 'action', 'data'):
                self.references.append(value)
        if tag in ('h1', 'h2'):
            self._heading = True
            self.headings.append('')
            self.words.append('')
            self.pictures.append([])
        if tag == 'img' and self.headings:
            self.pictures[-1].append(dict(attrs)['alt'])

    def handle_endtag(self, tag):
        if tag in ('h1', 'h2'):
            self._heading = False

    def handle_data(self, data):
        if self.cdata_elem is not None:  # a style, a script
            return
        data = data.replace('\N{MINUS SIGN}', '-')
        self._shown.append(data)
        if self.headings:
            part = self.headings if self._heading else self.words
            part[-1] += data

    def place(self, beginning: str) -> int:
        """Return where the only heading stands that begins so."""
        place, = (number for number, heading in enumerate(self.headings)
                  if heading.startswith(beginning))
        return place


def checked_page(path: Path, least_images: int) -> Page:
    """Return the page after checking that it needs nothing but itself."""
    page = Page(path)
    content = path.read_text(encoding='utf-8')
    assert not page.references
    assert not {'link', 'iframe'} & page.tags
    assert 'url(' not in content
    assert '@import' not in content
    assert len(page.images) >= least_images
    for image in page.images:
        kind, _, data = image.partition(',')
        assert kind == 'data:image/svg+xml;base64'
        root = ElementTree.fromstring(base64.b64decode(data))
        assert root.tag.endswith('svg')
        for element in root.iter():
            for name, value in element.attrib.items():
                if name.endswith('href'):
                    assert value.startswith('#')
    return page
