"""The five papers: what each printed beside what this program measures, as tables, figures and a page."""
