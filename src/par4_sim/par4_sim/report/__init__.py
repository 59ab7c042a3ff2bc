"""What a tool tells its user: words, pictures, pages and files that every report shares."""

import logging

# where the home is not writable it tells at length that it takes another folder for its cache
logging.getLogger('matplotlib').setLevel(logging.ERROR)
