/* The module volery.trace.spans in C: the same class and the same bytes as spans.py, whose docstrings apply. */

#include "growing_bytes.h"
#include <stddef.h>
#include <string.h>
#include <structmember.h>

enum { WRITTEN_AT_ONCE = 1000, MOST_DIGITS = 24, NAME_FIELDS = 2 };

/* A core of a processor, and the slice that it executes; `event` is NULL if there is none. */
typedef struct {
    PyObject *where;
    long long start, end;
    PyObject *event;
} Core;

typedef struct {
    PyObject_HEAD
    long long last;
    PyObject *write, *track_of, *name_of;
    Buffer lines;
    int waiting; /* lines that are not written yet */
    int begun;   /* whether a line has been written */
    long long pairs;
    PyObject *numbers; /* indexes in `cores` by processor and core */
    PyObject *names;   /* by task and component */
    Core *cores;
    int count;
} Spans;

/* The fields of a Slice. */
enum { START, END, PROCESSOR, CORE, TASK, COMPONENT, SLICE_FIELDS };

/* A line is put together from texts of C, texts of Python, and times; the first part that fails ends it. */
typedef struct {
    Spans *spans;
    Py_ssize_t used; /* of the buffer before the line */
    int failed;
} Line;

static void put(Line *line, const char *bytes, Py_ssize_t size)
{
    char *at = line->failed ? NULL : reserve(&line->spans->lines, size);
    if (at == NULL) {
        line->failed = 1;
        return;
    }
    memcpy(at, bytes, size);
    line->spans->lines.used += size;
}

#define PUT(line, text) put(line, text, sizeof text - 1)

static void put_text(Line *line, PyObject *text)
{
    Py_ssize_t size = 0;
    PyObject *replaced;
    const char *bytes = utf8(text, &size, &replaced);
    if (bytes == NULL)
        line->failed = 1;
    else
        put(line, bytes, size);
    Py_XDECREF(replaced);
}

static void put_number(Line *line, unsigned long long value, int least_digits)
{
    char digits[MOST_DIGITS], *at = digits + MOST_DIGITS;
    for (; value || least_digits > 0; value /= 10, least_digits--)
        *--at = (char)('0' + value % 10);
    put(line, at, digits + MOST_DIGITS - at);
}

/* Put a time in microseconds, rounded down, and the nanoseconds as decimals. */
static void put_time(Line *line, long long ns)
{
    long long micro = ns / 1000, nano = ns % 1000;
    if (nano < 0) {
        nano += 1000;
        micro--;
    }
    if (micro < 0)
        PUT(line, "-");
    put_number(line, micro < 0 ? -(unsigned long long)micro : (unsigned long long)micro, 1);
    PUT(line, ".");
    put_number(line, (unsigned long long)nano, 3);
}

static Line begin(Spans *spans)
{
    Line line = {spans, spans->lines.used, 0};
    if (spans->begun || spans->waiting)
        PUT(&line, ",\n");
    else
        PUT(&line, "[\n");
    return line;
}

static int write_out(Spans *spans)
{
    if (!spans->waiting)
        return 0;
    PyObject *done = PyObject_CallFunction(spans->write, "y#", spans->lines.bytes, spans->lines.used);
    spans->lines.used = 0;
    spans->waiting = 0;
    spans->begun = 1;
    Py_XDECREF(done);
    return done == NULL ? -1 : 0;
}

/* End a line; one that failed leaves no trace. */
static int end(Line *line)
{
    if (line->failed) {
        line->spans->lines.used = line->used;
        return -1;
    }
    return ++line->spans->waiting >= WRITTEN_AT_ONCE ? write_out(line->spans) : 0;
}

static void note_end(Spans *spans, long long time)
{
    if (time > spans->last)
        spans->last = time;
}

static int put_complete(Spans *spans, PyObject *name, long long start, long long stop, PyObject *where)
{
    note_end(spans, stop);
    Line line = begin(spans);
    PUT(&line, "{\"name\":");
    put_text(&line, name);
    PUT(&line, ",\"ph\":\"X\",\"ts\":");
    put_time(&line, start);
    PUT(&line, ",\"dur\":");
    put_time(&line, stop - start);
    PUT(&line, ",");
    put_text(&line, where);
    PUT(&line, "}");
    return end(&line);
}

static int put_half(Spans *spans, char half, PyObject **texts, long long time)
{
    PyObject *name = texts[0], *category = texts[1], *where = texts[2], *details = texts[3];
    Line line = begin(spans);
    PUT(&line, "{\"name\":");
    put_text(&line, name);
    PUT(&line, ",\"ph\":\"");
    put(&line, &half, 1);
    PUT(&line, "\",\"ts\":");
    put_time(&line, time);
    PUT(&line, ",");
    put_text(&line, category);
    PUT(&line, ",\"id\":");
    put_number(&line, (unsigned long long)spans->pairs, 1);
    PUT(&line, ",");
    put_text(&line, where);
    if (half == 'b') {
        PUT(&line, ",\"args\":");
        put_text(&line, details);
    }
    PUT(&line, "}");
    return end(&line);
}

static PyObject *nothing(int failed)
{
    if (failed)
        return NULL;
    Py_RETURN_NONE;
}

static PyObject *spans_add(Spans *spans, PyObject *text)
{
    Line line = begin(spans);
    put_text(&line, text);
    return nothing(end(&line));
}

static PyObject *spans_complete(Spans *spans, PyObject *arguments)
{
    PyObject *name, *where;
    long long start, stop;
    if (!PyArg_ParseTuple(arguments, "ULLU", &name, &start, &stop, &where))
        return NULL;
    return nothing(put_complete(spans, name, start, stop, where));
}

static PyObject *spans_pair(Spans *spans, PyObject *arguments)
{
    PyObject *texts[4];
    long long start, stop;
    if (!PyArg_ParseTuple(arguments, "ULLUUU", &texts[0], &start, &stop, &texts[1], &texts[2], &texts[3]))
        return NULL;
    note_end(spans, stop);
    spans->pairs++;
    return nothing(put_half(spans, 'b', texts, start) || put_half(spans, 'e', texts, stop));
}

static PyObject *spans_mark(Spans *spans, PyObject *arguments)
{
    PyObject *name, *scope, *rest;
    long long at;
    if (!PyArg_ParseTuple(arguments, "UULU", &name, &scope, &at, &rest))
        return NULL;
    note_end(spans, at);
    Line line = begin(spans);
    PUT(&line, "{\"name\":");
    put_text(&line, name);
    PUT(&line, ",\"ph\":\"i\",\"s\":\"");
    put_text(&line, scope);
    PUT(&line, "\",\"ts\":");
    put_time(&line, at);
    PUT(&line, ",");
    put_text(&line, rest);
    PUT(&line, "}");
    return nothing(end(&line));
}

/* Return what `table` has for a key of two fields of an event; call `make` with them if there is nothing yet.
 * Returns a new reference. */
static PyObject *known(PyObject *table, PyObject *make, PyObject *event, int field)
{
    PyObject *key = PyTuple_GetSlice(event, field, field + NAME_FIELDS);
    PyObject *found = key == NULL ? NULL : Py_XNewRef(PyDict_GetItemWithError(table, key));
    if (key != NULL && found == NULL && !PyErr_Occurred()) {
        found = PyObject_CallObject(make, key);
        if (found != NULL && PyDict_SetItem(table, key, found) < 0)
            Py_CLEAR(found);
    }
    Py_XDECREF(key);
    return found;
}

/* Add the slice of a core that has ended. */
static int put_slice(Spans *spans, int number)
{
    PyObject *event = spans->cores[number].event;
    if (spans->cores[number].where == NULL) {
        PyObject *where = PyObject_CallFunctionObjArgs(spans->track_of, PyTuple_GET_ITEM(event, PROCESSOR),
                                                       PyTuple_GET_ITEM(event, CORE), NULL);
        if (where == NULL)
            return -1;
        spans->cores[number].where = where;
    }
    PyObject *name = known(spans->names, spans->name_of, event, TASK);
    if (name == NULL)
        return -1;
    Core core = spans->cores[number];
    int failed = PyUnicode_Check(name) && PyUnicode_Check(core.where)
                     ? put_complete(spans, name, core.start, core.end, core.where)
                     : (PyErr_SetString(PyExc_TypeError, "a name or a track is no text"), -1);
    Py_DECREF(name);
    return failed;
}

/* Return the number of the core of a slice, -1 with an exception. */
static int core_number(Spans *spans, PyObject *event)
{
    PyObject *key = PyTuple_GetSlice(event, PROCESSOR, CORE + 1);
    if (key == NULL)
        return -1;
    long number = -1;
    PyObject *found = PyDict_GetItemWithError(spans->numbers, key);
    if (found != NULL)
        number = PyLong_AsLong(found);
    else if (!PyErr_Occurred()) {
        Core *cores = PyMem_Realloc(spans->cores, (spans->count + 1) * sizeof(Core));
        PyObject *next = PyLong_FromLong(spans->count);
        if (cores == NULL)
            PyErr_NoMemory();
        else {
            spans->cores = cores;
            memset(cores + spans->count, 0, sizeof(Core));
            if (next != NULL && PyDict_SetItem(spans->numbers, key, next) == 0)
                number = spans->count++;
        }
        Py_XDECREF(next);
    }
    Py_DECREF(key);
    return (int)number;
}

static int same(PyObject *one, PyObject *other)
{
    return one == other ? 1 : PyObject_RichCompareBool(one, other, Py_EQ);
}

static PyObject *spans_slice(Spans *spans, PyObject *event)
{
    if (!PyTuple_Check(event) || PyTuple_GET_SIZE(event) != SLICE_FIELDS)
        return PyErr_Format(PyExc_TypeError, "no slice: %R", event);
    long long start = PyLong_AsLong(PyTuple_GET_ITEM(event, START));
    long long stop = PyLong_AsLong(PyTuple_GET_ITEM(event, END));
    int number = PyErr_Occurred() ? -1 : core_number(spans, event);
    if (number < 0)
        return NULL;
    PyObject *before = spans->cores[number].event;
    int goes_on = before != NULL && spans->cores[number].end == start;
    for (int field = TASK; goes_on == 1 && field <= COMPONENT; field++)
        goes_on = same(PyTuple_GET_ITEM(before, field), PyTuple_GET_ITEM(event, field));
    if (goes_on < 0 || (before != NULL && !goes_on && put_slice(spans, number) < 0))
        return NULL;
    Core *core = spans->cores + number;
    if (!goes_on) {
        core->start = start;
        Py_XSETREF(core->event, Py_NewRef(event));
    }
    core->end = stop;
    Py_RETURN_NONE;
}

static PyObject *spans_end_slices(Spans *spans, PyObject *Py_UNUSED(none))
{
    for (int number = 0; number < spans->count; number++)
        if (spans->cores[number].event != NULL) {
            if (put_slice(spans, number) < 0)
                return NULL;
            Py_CLEAR(spans->cores[number].event);
        }
    Py_RETURN_NONE;
}

static PyObject *spans_close(Spans *spans, PyObject *Py_UNUSED(none))
{
    if (write_out(spans) < 0)
        return NULL;
    return PyObject_CallFunction(spans->write, "y", spans->begun ? "\n]\n" : "[]\n");
}

static PyObject *spans_new(PyTypeObject *type, PyObject *arguments, PyObject *Py_UNUSED(keywords))
{
    PyObject *write, *track_of, *name_of;
    if (!PyArg_ParseTuple(arguments, "OOO", &write, &track_of, &name_of))
        return NULL;
    Spans *spans = (Spans *)type->tp_alloc(type, 0); /* filled with zeros */
    if (spans == NULL)
        return NULL;
    spans->write = Py_NewRef(write);
    spans->track_of = Py_NewRef(track_of);
    spans->name_of = Py_NewRef(name_of);
    spans->numbers = PyDict_New();
    spans->names = PyDict_New();
    if (spans->numbers == NULL || spans->names == NULL)
        Py_CLEAR(spans);
    return (PyObject *)spans;
}

static int spans_traverse(Spans *spans, visitproc visit, void *arg)
{
    Py_VISIT(spans->write);
    Py_VISIT(spans->track_of);
    Py_VISIT(spans->name_of);
    Py_VISIT(spans->numbers);
    Py_VISIT(spans->names);
    for (int number = 0; number < spans->count; number++) {
        Py_VISIT(spans->cores[number].where);
        Py_VISIT(spans->cores[number].event);
    }
    return 0;
}

static int spans_clear(Spans *spans)
{
    Py_CLEAR(spans->write);
    Py_CLEAR(spans->track_of);
    Py_CLEAR(spans->name_of);
    Py_CLEAR(spans->numbers);
    Py_CLEAR(spans->names);
    for (int number = 0; number < spans->count; number++) {
        Py_CLEAR(spans->cores[number].where);
        Py_CLEAR(spans->cores[number].event);
    }
    return 0;
}

static void spans_dealloc(Spans *spans)
{
    PyObject_GC_UnTrack(spans);
    spans_clear(spans);
    PyMem_Free(spans->cores);
    PyMem_Free(spans->lines.bytes);
    Py_TYPE(spans)->tp_free(spans);
}

static PyMemberDef spans_members[] = {
    {"last", T_LONGLONG, offsetof(Spans, last), 0, NULL},
    {NULL},
};

static PyMethodDef spans_methods[] = {
    {"add", (PyCFunction)spans_add, METH_O, NULL},
    {"complete", (PyCFunction)spans_complete, METH_VARARGS, NULL},
    {"pair", (PyCFunction)spans_pair, METH_VARARGS, NULL},
    {"mark", (PyCFunction)spans_mark, METH_VARARGS, NULL},
    {"slice", (PyCFunction)spans_slice, METH_O, NULL},
    {"end_slices", (PyCFunction)spans_end_slices, METH_NOARGS, NULL},
    {"close", (PyCFunction)spans_close, METH_NOARGS, NULL},
    {NULL},
};

static PyTypeObject SpansType = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "volery.trace.spans.Spans",
    .tp_basicsize = sizeof(Spans),
    .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC,
    .tp_new = spans_new,
    .tp_dealloc = (destructor)spans_dealloc,
    .tp_traverse = (traverseproc)spans_traverse,
    .tp_clear = (inquiry)spans_clear,
    .tp_methods = spans_methods,
    .tp_members = spans_members,
};

static PyModuleDef module = {PyModuleDef_HEAD_INIT, .m_name = "volery.trace.spans", .m_size = -1};

PyMODINIT_FUNC PyInit_spans(void)
{
    if (PyType_Ready(&SpansType) < 0)
        return NULL;
    PyObject *made = PyModule_Create(&module);
    if (made != NULL && PyModule_AddObjectRef(made, "Spans", (PyObject *)&SpansType) < 0)
        Py_CLEAR(made);
    return made;
}
