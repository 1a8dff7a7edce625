"""The case file: models of its tables, what they accept, messages, and the reference page.

Imports: the options of `contact.methods` and of `contact.output`, the shapes of
`contact.interface`; nothing is built or solved here.
"""
