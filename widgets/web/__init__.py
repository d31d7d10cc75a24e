"""The editor in a browser.

The folders, in reading order:

    serving         ``segdeform serve``: one client process for each page
"""
