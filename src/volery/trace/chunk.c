/* The module volery.trace.chunk in C: the same class and the same bytes as chunk.py, whose docstrings apply.
 *
 * A record is written in one pass from the fields of an event, which is a tuple, to the end of a buffer that
 * grows. The used length of the buffer changes when the record is whole, so an error leaves no half record.
 */

#include "growing_bytes.h"
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <structmember.h>

enum {
    MESSAGE = 5,
    MESSAGE_INDEX = 7,
    MOST_FIELDS = 32,
    MOST_CHANNELS = 1 << 16,
    FRAME = 31,        /* opcode 1, length 8, channel 2, sequence 4, log time 8, publish time 8 */
    LENGTH_IN_FRAME = 9,
    INDEX_HEAD = 15,   /* opcode 1, length 8, channel 2, length of the pairs 4 */
    LITTLE_ENDIAN_CDR = 0x0100
};

static char *put(char *at, uint64_t value, int width)
{
    for (int i = 0; i < width; i++)
        at[i] = (char)(value >> (8 * i));
    return at + width;
}

/* The chunk. The index of a channel is its log times and offsets, alternating; `order` has the channels in the
 * order of their first message. */
typedef struct {
    PyObject_HEAD
    long long end;
    PyObject *end_second;
    Buffer records;
    Buffer *indexes;
    int channels;
    Buffer order;
    int64_t first, last;
} Chunk;

/* The function that writes events of one kind: a layout, and the channels of its subjects. */
typedef struct {
    PyObject_HEAD
    Chunk *chunk;
    PyObject *open_channel;
    PyObject *known; /* channels by subject */
    Py_ssize_t size; /* fields that an event must have */
    int log, publish, data;
    int subjects, numbers, words;
    int subject[MOST_FIELDS], number[MOST_FIELDS], word[MOST_FIELDS];
    char codes[MOST_FIELDS + 1];
    int padding;
} Writer;

static PyTypeObject ChunkType, WriterType;

/* Make room for the index of a channel. */
static Buffer *index_of(Chunk *chunk, int channel)
{
    if (channel >= chunk->channels) {
        int channels = channel + 64;
        Buffer *indexes = PyMem_Realloc(chunk->indexes, channels * sizeof(Buffer));
        if (indexes == NULL)
            return (Buffer *)PyErr_NoMemory();
        memset(indexes + chunk->channels, 0, (channels - chunk->channels) * sizeof(Buffer));
        chunk->indexes = indexes;
        chunk->channels = channels;
    }
    return chunk->indexes + channel;
}

/* Return the channel of an event, -1 with an exception. */
static int channel_of(Writer *writer, PyObject *event)
{
    PyObject *subject = PyTuple_New(writer->subjects);
    if (subject == NULL)
        return -1;
    for (int i = 0; i < writer->subjects; i++) {
        PyObject *field = PyTuple_GET_ITEM(event, writer->subject[i]);
        PyTuple_SET_ITEM(subject, i, Py_NewRef(field));
    }
    PyObject *channel = Py_XNewRef(PyDict_GetItemWithError(writer->known, subject));
    if (channel == NULL && !PyErr_Occurred()) {
        channel = PyObject_CallObject(writer->open_channel, subject);
        if (channel != NULL && PyDict_SetItem(writer->known, subject, channel) < 0)
            Py_CLEAR(channel);
    }
    Py_DECREF(subject);
    if (channel == NULL)
        return -1;
    long number = PyLong_AsLong(channel);
    Py_DECREF(channel);
    if (number >= 0 && number < MOST_CHANNELS)
        return (int)number;
    if (!PyErr_Occurred())
        PyErr_Format(PyExc_OverflowError, "channel %ld: a trace has at most %d", number, MOST_CHANNELS);
    return -1;
}

/* Write the numbers of an event; return where they end, NULL with an exception. */
static char *put_numbers(char *at, Writer *writer, PyObject *event)
{
    for (int i = 0; i < writer->numbers; i++) {
        PyObject *field = PyTuple_GET_ITEM(event, writer->number[i]);
        uint64_t bits = 0;
        int width = 8;
        switch (writer->codes[i]) {
        case 'q':
            bits = (uint64_t)PyLong_AsLong(field);
            break;
        case 'd': {
            double value = PyFloat_AsDouble(field);
            memcpy(&bits, &value, sizeof bits);
            break;
        }
        case 'i': {
            long long value = PyLong_AsLong(field);
            if (value != (int32_t)value) {
                PyErr_Format(PyExc_OverflowError, "%R does not fit an int32", field);
                return NULL;
            }
            bits = (uint64_t)value;
            width = 4;
            break;
        }
        default: {
            int truth = PyObject_IsTrue(field);
            bits = (uint64_t)truth;
            width = 1;
        }
        }
        if ((bits == UINT64_MAX || writer->codes[i] == 'd') && PyErr_Occurred())
            return NULL;
        at = put(at, bits, width);
    }
    memset(at, 0, writer->padding);
    return at + writer->padding;
}

/* Append a string in CDR to the records at *length bytes behind their end, and add its size to *length. */
static int put_word(Buffer *records, Py_ssize_t *length, PyObject *word)
{
    Py_ssize_t size;
    PyObject *replaced;
    const char *text = utf8(word, &size, &replaced);
    if (text == NULL)
        return -1;
    Py_ssize_t padded = (size + 1 + 3) / 4 * 4;
    char *at = reserve(records, *length + 4 + padded);
    if (at != NULL) {
        at = put(at + *length, (uint64_t)size + 1, 4);
        memcpy(at, text, size);
        memset(at + size, 0, padded - size);
        *length += 4 + padded;
    }
    Py_XDECREF(replaced);
    return at == NULL ? -1 : 0;
}

/* Append the message of an event behind the room for its frame; return the length of both, -1 on an error. */
static Py_ssize_t put_message(Writer *writer, PyObject *event)
{
    Buffer *records = &writer->chunk->records;
    Py_ssize_t length = FRAME;
    if (writer->data >= 0) {
        char *bytes;
        Py_ssize_t size;
        if (PyBytes_AsStringAndSize(PyTuple_GET_ITEM(event, writer->data), &bytes, &size) < 0)
            return -1;
        char *at = reserve(records, FRAME + size);
        if (at == NULL)
            return -1;
        memcpy(at + FRAME, bytes, size);
        return FRAME + size;
    }
    char *begin = reserve(records, FRAME + 4 + 8 * writer->numbers + 4);
    if (begin == NULL)
        return -1;
    char *at = put_numbers(put(begin + FRAME, LITTLE_ENDIAN_CDR, 4), writer, event);
    if (at == NULL)
        return -1;
    length = at - begin;
    for (int i = 0; i < writer->words; i++)
        if (put_word(records, &length, PyTuple_GET_ITEM(event, writer->word[i])) < 0)
            return -1;
    return length;
}

static int put_index(Chunk *chunk, int channel, int64_t log)
{
    Buffer *index = index_of(chunk, channel);
    if (index == NULL || reserve(index, 16) == NULL)
        return -1;
    if (index->used == 0) {
        char *at = reserve(&chunk->order, sizeof channel);
        if (at == NULL)
            return -1;
        memcpy(at, &channel, sizeof channel);
        chunk->order.used += sizeof channel;
    }
    put(put(index->bytes + index->used, (uint64_t)log, 8), (uint64_t)chunk->records.used, 8);
    index->used += 16;
    return 0;
}

static PyObject *write_event(Writer *writer, PyObject *event)
{
    Chunk *chunk = writer->chunk;
    if (!PyTuple_Check(event) || PyTuple_GET_SIZE(event) < writer->size)
        return PyErr_Format(PyExc_TypeError, "no event of this kind: %R", event);
    long long log = PyLong_AsLong(PyTuple_GET_ITEM(event, writer->log));
    long long publish = PyLong_AsLong(PyTuple_GET_ITEM(event, writer->publish));
    if (PyErr_Occurred())
        return NULL;
    if (log < 0)
        log = publish;
    if (publish < 0)
        return PyErr_Format(PyExc_OverflowError, "an event before the start of the run: %R", event);
    if (publish >= chunk->end) {
        PyObject *done = PyObject_CallFunction(chunk->end_second, "L", publish);
        if (done == NULL)
            return NULL;
        Py_DECREF(done);
    }
    int channel = channel_of(writer, event);
    if (channel < 0)
        return NULL;
    Py_ssize_t length = put_message(writer, event);
    if (length < 0 || put_index(chunk, channel, log) < 0)
        return NULL;
    char *at = chunk->records.bytes + chunk->records.used;
    *at = MESSAGE;
    at = put(put(at + 1, (uint64_t)length - LENGTH_IN_FRAME, 8), (uint64_t)channel, 2);
    put(put(put(at, 0, 4), (uint64_t)log, 8), (uint64_t)publish, 8);
    chunk->records.used += length;
    if (log < chunk->first)
        chunk->first = log;
    if (log > chunk->last)
        chunk->last = log;
    Py_RETURN_NONE;
}

static PyMethodDef write_method = {"write", (PyCFunction)write_event, METH_O, NULL};

/* Return the index of a field, at least `least`, and note how many fields an event must have. */
static int field_index(PyObject *given, int least, Py_ssize_t *size)
{
    long index = PyLong_AsLong(given);
    if (!PyErr_Occurred() && (index < least || index >= MOST_FIELDS))
        PyErr_Format(PyExc_ValueError, "%ld: not the index of a field", index);
    if (index >= *size)
        *size = index + 1;
    return (int)index;
}

/* Copy the indexes of fields from a tuple; return how many, -1 with an exception. */
static int copy_fields(PyObject *layout, const char *name, int *fields, Py_ssize_t *size)
{
    PyObject *given = PyObject_GetAttrString(layout, name);
    if (given == NULL)
        return -1;
    int count = -1;
    if (!PyTuple_Check(given) || PyTuple_GET_SIZE(given) > MOST_FIELDS)
        PyErr_Format(PyExc_ValueError, "%s: not a tuple of at most %d fields", name, MOST_FIELDS);
    else {
        count = (int)PyTuple_GET_SIZE(given);
        for (int i = 0; i < count; i++)
            fields[i] = field_index(PyTuple_GET_ITEM(given, i), 0, size);
    }
    Py_DECREF(given);
    return PyErr_Occurred() ? -1 : count;
}

static int copy_field(PyObject *layout, const char *name, int least, int *field, Py_ssize_t *size)
{
    PyObject *given = PyObject_GetAttrString(layout, name);
    if (given == NULL)
        return -1;
    *field = field_index(given, least, size);
    Py_DECREF(given);
    return PyErr_Occurred() ? -1 : 0;
}

static int copy_codes(PyObject *layout, Writer *writer)
{
    PyObject *given = PyObject_GetAttrString(layout, "codes");
    const char *codes = given == NULL ? NULL : PyUnicode_AsUTF8(given);
    int width = 0;
    if (codes != NULL && (int)strlen(codes) == writer->numbers && strspn(codes, "qdi?") == strlen(codes)) {
        strcpy(writer->codes, codes);
        for (; *codes; codes++)
            width += *codes == '?' ? 1 : *codes == 'i' ? 4 : 8;
        writer->padding = (4 - width % 4) % 4;
    } else if (!PyErr_Occurred())
        PyErr_SetString(PyExc_ValueError, "codes: not one of q, d, i and ? for each number");
    Py_XDECREF(given);
    return PyErr_Occurred() ? -1 : 0;
}

static PyObject *chunk_writer(Chunk *chunk, PyObject *arguments)
{
    PyObject *layout, *open_channel;
    if (!PyArg_ParseTuple(arguments, "OO", &layout, &open_channel))
        return NULL;
    Writer *writer = PyObject_GC_New(Writer, &WriterType);
    if (writer == NULL)
        return NULL;
    writer->chunk = (Chunk *)Py_NewRef(chunk);
    writer->open_channel = Py_NewRef(open_channel);
    writer->known = PyDict_New();
    writer->size = 0;
    PyObject_GC_Track(writer);
    PyObject *write = NULL;
    if (writer->known != NULL && copy_field(layout, "log", 0, &writer->log, &writer->size) == 0 &&
        copy_field(layout, "publish", 0, &writer->publish, &writer->size) == 0 &&
        copy_field(layout, "data", -1, &writer->data, &writer->size) == 0 &&
        (writer->subjects = copy_fields(layout, "subject", writer->subject, &writer->size)) >= 0 &&
        (writer->numbers = copy_fields(layout, "numbers", writer->number, &writer->size)) >= 0 &&
        (writer->words = copy_fields(layout, "words", writer->word, &writer->size)) >= 0 &&
        copy_codes(layout, writer) == 0)
        write = PyCFunction_New(&write_method, (PyObject *)writer);
    Py_DECREF(writer);
    return write;
}

static PyObject *chunk_add(Chunk *chunk, PyObject *record)
{
    char *bytes;
    Py_ssize_t size;
    if (PyBytes_AsStringAndSize(record, &bytes, &size) < 0)
        return NULL;
    char *at = reserve(&chunk->records, size);
    if (at == NULL)
        return NULL;
    memcpy(at, bytes, size);
    chunk->records.used += size;
    Py_RETURN_NONE;
}

/* Set the entry of a channel in a dictionary of Python integers. */
static int set_entry(PyObject *entries, int channel, Py_ssize_t value)
{
    PyObject *key = PyLong_FromLong(channel), *number = PyLong_FromSsize_t(value);
    int done = key == NULL || number == NULL ? -1 : PyDict_SetItem(entries, key, number);
    Py_XDECREF(key);
    Py_XDECREF(number);
    return done;
}

static PyObject *chunk_take(Chunk *chunk, PyObject *Py_UNUSED(nothing))
{
    int channels = (int)(chunk->order.used / sizeof(int));
    if (channels == 0)
        Py_RETURN_NONE;
    const int *order = (const int *)chunk->order.bytes;
    Py_ssize_t size = 0;
    for (int i = 0; i < channels; i++)
        size += INDEX_HEAD + chunk->indexes[order[i]].used;
    PyObject *offsets = PyDict_New(), *counts = PyDict_New();
    PyObject *indexes = PyBytes_FromStringAndSize(NULL, size);
    PyObject *taken = NULL;
    if (offsets == NULL || counts == NULL || indexes == NULL)
        goto end;
    char *begin = PyBytes_AS_STRING(indexes), *at = begin;
    for (int i = 0; i < channels; i++) {
        Buffer *index = chunk->indexes + order[i];
        if (set_entry(offsets, order[i], at - begin) < 0 || set_entry(counts, order[i], index->used / 16) < 0)
            goto end;
        *at = MESSAGE_INDEX;
        at = put(put(at + 1, (uint64_t)index->used + 6, 8), (uint64_t)order[i], 2);
        at = put(at, (uint64_t)index->used, 4);
        memcpy(at, index->bytes, index->used);
        at += index->used;
    }
    taken = Py_BuildValue("y#OOOLL", chunk->records.bytes, chunk->records.used, indexes, offsets, counts,
                          (long long)chunk->first, (long long)chunk->last);
    if (taken == NULL)
        goto end;
    for (int i = 0; i < channels; i++)
        chunk->indexes[order[i]].used = 0;
    chunk->records.used = chunk->order.used = 0;
    chunk->first = INT64_MAX;
    chunk->last = 0;
end:
    Py_XDECREF(offsets);
    Py_XDECREF(counts);
    Py_XDECREF(indexes);
    return taken;
}

static PyObject *chunk_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords)
{
    static char *names[] = {"end_second", NULL};
    PyObject *end_second;
    if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "O", names, &end_second))
        return NULL;
    Chunk *chunk = (Chunk *)type->tp_alloc(type, 0); /* filled with zeros */
    if (chunk != NULL) {
        chunk->end_second = Py_NewRef(end_second);
        chunk->first = INT64_MAX;
    }
    return (PyObject *)chunk;
}

static int chunk_traverse(Chunk *chunk, visitproc visit, void *arg)
{
    Py_VISIT(chunk->end_second);
    return 0;
}

static int chunk_clear(Chunk *chunk)
{
    Py_CLEAR(chunk->end_second);
    return 0;
}

static void chunk_dealloc(Chunk *chunk)
{
    PyObject_GC_UnTrack(chunk);
    chunk_clear(chunk);
    for (int i = 0; i < chunk->channels; i++)
        PyMem_Free(chunk->indexes[i].bytes);
    PyMem_Free(chunk->indexes);
    PyMem_Free(chunk->order.bytes);
    PyMem_Free(chunk->records.bytes);
    Py_TYPE(chunk)->tp_free(chunk);
}

static int writer_traverse(Writer *writer, visitproc visit, void *arg)
{
    Py_VISIT(writer->chunk);
    Py_VISIT(writer->open_channel);
    Py_VISIT(writer->known);
    return 0;
}

static int writer_clear(Writer *writer)
{
    Py_CLEAR(writer->open_channel);
    Py_CLEAR(writer->known);
    return 0;
}

static void writer_dealloc(Writer *writer)
{
    PyObject_GC_UnTrack(writer);
    writer_clear(writer);
    Py_CLEAR(writer->chunk);
    PyObject_GC_Del(writer);
}

static PyMemberDef chunk_members[] = {
    {"end", T_LONGLONG, offsetof(Chunk, end), 0, NULL},
    {NULL},
};

static PyMethodDef chunk_methods[] = {
    {"add", (PyCFunction)chunk_add, METH_O, NULL},
    {"writer", (PyCFunction)chunk_writer, METH_VARARGS, NULL},
    {"take", (PyCFunction)chunk_take, METH_NOARGS, NULL},
    {NULL},
};

static PyTypeObject ChunkType = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "volery.trace.chunk.Chunk",
    .tp_basicsize = sizeof(Chunk),
    .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC,
    .tp_new = chunk_new,
    .tp_dealloc = (destructor)chunk_dealloc,
    .tp_traverse = (traverseproc)chunk_traverse,
    .tp_clear = (inquiry)chunk_clear,
    .tp_methods = chunk_methods,
    .tp_members = chunk_members,
};

static PyTypeObject WriterType = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "volery.trace.chunk.Writer",
    .tp_basicsize = sizeof(Writer),
    .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC,
    .tp_dealloc = (destructor)writer_dealloc,
    .tp_traverse = (traverseproc)writer_traverse,
    .tp_clear = (inquiry)writer_clear,
};

static PyModuleDef module = {PyModuleDef_HEAD_INIT, .m_name = "volery.trace.chunk", .m_size = -1};

PyMODINIT_FUNC PyInit_chunk(void)
{
    PyObject *made;
    if (PyType_Ready(&ChunkType) < 0 || PyType_Ready(&WriterType) < 0)
        return NULL;
    made = PyModule_Create(&module);
    if (made != NULL && PyModule_AddObjectRef(made, "Chunk", (PyObject *)&ChunkType) < 0)
        Py_CLEAR(made);
    return made;
}
