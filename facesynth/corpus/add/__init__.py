"""From files of any kind to utterances of a corpus."""
