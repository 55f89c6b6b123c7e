"""Words for channels, references, commands and units in headers, in ten languages. Data only.

Words are in lower case, several of one name joined by underscores; a header matches whole words, also
without accents.
"""

from __future__ import annotations

import unicodedata

CHANNELS: dict[str, dict[str, str]] = {
    "time": {
        "en": "t ts time timestamp time_stamp datetime elapsed elapsed_time millis micros",
        "de": "zeit zeitstempel uhrzeit messzeit laufzeit",
        "fr": "temps temps_écoulé horodatage heure", "it": "tempo ora",
        "pt": "tempo hora tempo_decorrido", "es": "tiempo hora tiempo_transcurrido",
        "ja": "時間 時刻 経過時間 計測時間", "zh": "时间 时刻 時間 采样时间",
        "ko": "시간 시각 경과시간"},
    "pressure": {
        "en": "p press pressure", "de": "druck überdruck luftdruck innendruck muskeldruck",
        "fr": "pression", "it": "pressione", "es": "presión", "pt": "pressão",
        "ja": "圧力 圧 空気圧 空気圧力 内圧", "zh": "压力 压强 气压 壓力 氣壓 内压",
        "ko": "압력 공기압 공압"},
    "voltage": {
        "en": "u voltage valve_voltage command_voltage", "de": "spannung ventilspannung",
        "fr": "voltage tension_électrique", "it": "tensione", "es": "tensión voltaje",
        "pt": "tensão voltagem", "ja": "電圧", "zh": "电压 電壓", "ko": "전압"},
    "displacement": {
        "en": "disp displacement pos position stroke shortening",
        "de": "weg hub verschiebung auslenkung verkürzung",
        "fr": "déplacement course position raccourcissement",
        "it": "spostamento corsa posizione accorciamento",
        "es": "desplazamiento posición carrera acortamiento",
        "pt": "deslocamento posição curso encurtamento",
        "ja": "変位 変位量 位置 ストローク 収縮量", "zh": "位移 位移量 变形量 变形 位置 行程 收缩量",
        "ko": "변위 위치 스트로크 수축량"},
    "length": {
        "en": "l length", "de": "länge laenge", "fr": "longueur", "it": "lunghezza",
        "es": "longitud", "pt": "comprimento", "ja": "長さ 全長", "zh": "长度 長度", "ko": "길이"},
    "contraction": {
        "en": "contraction contraction_ratio", "de": "kontraktion",
        "fr": "contraction taux_de_contraction", "it": "contrazione", "es": "contracción",
        "pt": "contração", "ja": "収縮率", "zh": "收缩率", "ko": "수축률"},
    "force": {
        "en": "f force load", "de": "kraft zugkraft", "fr": "force effort_de_traction",
        "it": "forza carico", "es": "fuerza carga", "pt": "força carga", "ja": "力 荷重 張力 推力",
        "zh": "力 力值 拉力 推力 载荷", "ko": "힘 하중 장력"},
    "torque": {
        "en": "torque", "de": "drehmoment", "fr": "couple", "it": "coppia", "es": "par_motor",
        "pt": "binário torque", "ja": "トルク", "zh": "扭矩 转矩", "ko": "토크"},
    "velocity": {
        "en": "velocity vel speed", "de": "geschwindigkeit", "fr": "vitesse", "it": "velocità",
        "es": "velocidad", "pt": "velocidade", "ja zh": "速度", "ko": "속도"},
    "angle": {
        "en": "angle theta", "de": "winkel drehwinkel", "fr": "angle", "it": "angolo",
        "es": "ángulo", "pt": "ângulo", "ja": "角度 角 関節角度", "zh": "角度 转角 关节角度",
        "ko": "각도"},
    "temperature": {
        "en": "temperature temp", "de": "temperatur", "fr": "température",
        "it es pt": "temperatura", "ja": "温度", "zh": "温度 溫度", "ko": "온도"},
}  # fmt: skip
"""Standard channel -> language -> the words for it."""

AMBIGUOUS = {"tension", "effort", "charge"}
"""Words for one channel in one language and another in the next: the unit decides."""

ROLES: dict[str, dict[str, str]] = {
    "reference": {
        "en": "reference ref setpoint desired target", "de": "sollwert soll",
        "fr": "consigne référence", "it": "riferimento", "es": "referencia consigna objetivo",
        "pt": "referência alvo", "ja": "目標 目標値 設定 設定値",
        "zh": "目标 目标值 设定 设定值 期望 给定", "ko": "목표 목표값 설정"},
    "command": {
        "en": "command commanded cmd", "de": "stellgröße stellgroesse", "fr": "commande",
        "it es pt": "comando", "ja zh": "指令 指令値 指令值", "ko": "명령 지령"},
}  # fmt: skip
"""References and commands of a loop -> words for them, used with or instead of a channel's name."""

MUSCLES: dict[str, dict[str, str]] = {
    "extensor": {
        "en": "extensor ext", "de": "strecker", "fr": "extenseur", "it": "estensore", "ja": "伸筋",
        "zh": "伸肌", "ko": "신근"},
    "flexor": {
        "en": "flexor flex", "de": "beuger", "fr": "fléchisseur", "it": "flessore", "ja": "屈筋",
        "zh": "屈肌", "ko": "굴근"},
}  # fmt: skip
"""Muscles of a joint or a backbone -> words for them, used with a pressure's name."""

MEASURED: dict[str, dict[str, str]] = {
    "measured": {
        "en": "measured meas actual", "de": "istwert ist gemessen", "fr": "mesuré mesurée",
        "it": "misurato misurata", "es pt": "medido medida", "ja": "実測 測定 測定値",
        "zh": "实测 实测值 测量", "ko": "측정 측정값"},
}  # fmt: skip
"""Words for what is no reference or command, used with a channel's name."""

UNITS: dict[str, dict[str, str]] = {
    "bar": {"es pt": "bares", "ja": "バール", "zh": "巴"},
    "mbar": {"en": "millibar", "es pt": "milibar", "ja": "ミリバール", "zh": "毫巴"},
    "Pa": {
        "en": "pascal pascals", "es": "pascales", "ja": "パスカル", "zh": "帕 帕斯卡", "ko": "파스칼"},
    "hPa": {"en": "hectopascal", "de": "hektopascal", "ja": "ヘクトパスカル", "zh": "百帕"},
    "kPa": {
        "en": "kilopascal kilopascals", "es": "kilopascales", "pt": "quilopascal",
        "ja": "キロパスカル", "zh": "千帕", "ko": "킬로파스칼"},
    "MPa": {
        "en": "megapascal megapascals", "es": "megapascales", "ja": "メガパスカル", "zh": "兆帕",
        "ko": "메가파스칼"},
    "mmHg": {"en": "mm_hg"},
    "mm": {
        "en": "millimeter millimeters millimetre millimetres", "fr": "millimètre millimètres",
        "it": "millimetro millimetri", "es": "milímetro milímetros", "ja": "ミリメートル ミリ",
        "zh": "毫米 公釐", "ko": "밀리미터"},
    "cm": {
        "en": "centimeter centimeters centimetre centimetres", "de": "zentimeter",
        "fr": "centimètre centimètres", "it": "centimetro centimetri",
        "es pt": "centímetro centímetros", "ja": "センチメートル センチ", "zh": "厘米 公分",
        "ko": "센티미터"},
    "m": {
        "en": "meter meters metre metres", "fr": "mètre mètres", "it": "metro metri",
        "es pt": "metro metros", "ja": "メートル", "zh": "米 公尺", "ko": "미터"},
    "um": {
        "en": "micron microns micrometer micrometers micrometre micrometres", "de": "mikrometer",
        "fr": "micromètre micromètres", "it": "micrometro micrometri",
        "es": "micrómetro micrómetros", "ja": "マイクロメートル ミクロン", "zh": "微米",
        "ko": "마이크로미터"},
    "inch": {
        "en": "inch inches", "de": "zoll", "fr": "pouce pouces", "it": "pollice pollici",
        "es": "pulgada pulgadas", "pt": "polegada polegadas", "ja": "インチ", "zh": "英寸",
        "ko": "인치"},
    "N": {"en": "newton newtons", "ja": "ニュートン", "zh": "牛 牛顿 牛頓", "ko": "뉴턴"},
    "kN": {"en": "kilonewton kilonewtons", "ja": "キロニュートン", "zh": "千牛", "ko": "킬로뉴턴"},
    "mN": {"en": "millinewton millinewtons", "ja": "ミリニュートン", "zh": "毫牛"},
    "s": {
        "en": "second seconds", "de": "sekunde sekunden sek", "fr": "seconde secondes",
        "it": "secondo secondi", "es pt": "segundo segundos seg", "ja zh": "秒", "ko": "초"},
    "ms": {
        "en": "millisecond milliseconds millis", "de": "millisekunde millisekunden",
        "fr": "milliseconde millisecondes", "it": "millisecondo millisecondi",
        "es": "milisegundo milisegundos", "pt": "milissegundo milissegundos", "ja": "ミリ秒",
        "zh": "毫秒", "ko": "밀리초"},
    "us": {
        "en": "microsecond microseconds micros", "de": "mikrosekunde mikrosekunden",
        "fr": "microseconde microsecondes", "it": "microsecondo microsecondi",
        "es": "microsegundo microsegundos", "pt": "microssegundo microssegundos",
        "ja": "マイクロ秒", "zh": "微秒", "ko": "마이크로초"},
    "min": {
        "en": "minute minutes", "de": "minuten", "it": "minuto minuti", "es pt": "minuto minutos",
        "ja": "分", "zh": "分钟 分鐘", "ko": "분"},
    "hour": {  # in the singular, the words of others for the time of day
        "en": "hour hours", "de": "stunde stunden", "fr": "heures", "it": "ore", "es pt": "horas",
        "zh": "小时 小時"},
    "day": {
        "en": "day days", "de": "tage", "fr": "jours", "it": "giorni", "es": "días", "pt": "dias"},
    "rad": {
        "en": "radian radians", "de": "radiant", "it": "radiante radianti", "es": "radián radianes",
        "pt": "radiano radianos", "ja": "ラジアン", "zh": "弧度", "ko": "라디안"},
    "deg": {
        "en": "degree degrees", "de": "grad", "fr": "degré degrés", "it": "grado gradi",
        "es": "grados", "pt": "grau graus", "ja zh": "度", "ko": "도"},
    "turn": {
        "en": "revolution revolutions turn turns", "de": "umdrehung umdrehungen", "fr": "tour tours",
        "it": "giri", "es": "vuelta vueltas", "pt": "volta voltas", "ja": "回転", "zh": "圈"},
    "V": {
        "en": "volt volts", "es": "voltio voltios", "ja": "ボルト", "zh": "伏 伏特", "ko": "볼트"},
    "mV": {
        "en": "millivolt millivolts", "es": "milivoltio milivoltios", "ja": "ミリボルト", "zh": "毫伏",
        "ko": "밀리볼트"},
    "A": {
        "en": "ampere amperes", "es": "amperio amperios", "ja": "アンペア", "zh": "安 安培",
        "ko": "암페어"},
    "mA": {"en": "milliampere milliamperes", "es": "miliamperio miliamperios", "zh": "毫安"},
    "degC": {
        "en": "celsius degrees_celsius", "de": "grad_celsius", "fr": "degrés_celsius",
        "it": "gradi_celsius", "es": "grados_celsius", "pt": "graus_celsius", "ja": "摂氏",
        "zh": "摄氏度 攝氏度", "ko": "섭씨"},
    "percent": {
        "en": "percent", "de": "prozent", "fr": "pour_cent", "it": "per_cento percento",
        "es": "por_ciento", "pt": "por_cento", "ja": "パーセント", "ko": "퍼센트"},
    "Hz": {"en": "hertz", "ja": "ヘルツ", "zh": "赫兹", "ko": "헤르츠"},
    "N*m": {
        "en": "newtonmeter newtonmeters", "fr": "newton_mètre newton_mètres",
        "ja": "ニュートンメートル", "zh": "牛米 牛顿米"},
    "rpm": {"de": "u/min", "fr": "tr/min tours/min", "it": "giri/min"},
    "g": {
        "en": "gram grams", "de": "gramm", "fr": "gramme grammes", "it": "grammo grammi",
        "es": "gramo gramos", "pt": "grama gramas", "ja": "グラム", "zh": "克", "ko": "그램"},
    "kg": {
        "en": "kilogram kilograms", "de": "kilogramm", "fr": "kilogramme kilogrammes",
        "it": "chilogrammo chilogrammi", "es": "kilogramo kilogramos",
        "pt": "quilograma quilogramas", "ja": "キログラム キロ", "zh": "千克 公斤", "ko": "킬로그램"},
    "absolute": {
        "en": "abs absolute", "de": "absolut", "fr": "absolu absolue absolus",
        "it": "assoluta assoluto", "es pt": "absoluta absoluto", "ja": "絶対 絶対圧",
        "zh": "绝对 绝压 絕對", "ko": "절대"},
    "gauge": {
        "en": "gauge", "de": "überdruck relativ", "fr": "relatif relative relatifs",
        "it": "relativa relativo", "es pt": "manométrica relativa", "ja": "ゲージ ゲージ圧",
        "zh": "表压 錶壓", "ko": "게이지"},
    "/": {"en": "per", "de": "pro", "fr": "par", "it": "al", "es pt": "por"},
}  # fmt: skip
"""Symbol of a unit -> language -> the words for it; also for references of pressures and ``per``."""


def plain(word: str) -> str:
    """Return a word without accents; the marks of Japanese and Korean are none.

    >>> plain("millimètres"), plain("ゲージ")
    ('millimetres', 'ゲージ')
    """
    letters = (c for c in unicodedata.normalize("NFD", word) if not "\u0300" <= c <= "\u036f")
    return unicodedata.normalize("NFC", "".join(letters))


def words_of(table: dict[str, dict[str, str]]) -> dict[str, str]:
    """Return the meaning of each word of a table.

    >>> words_of(CHANNELS)["druck"]
    'pressure'
    """
    return {
        form: meaning
        for meaning, languages in table.items()
        for words in languages.values()
        for word in words.split()
        for form in (word, plain(word))
        if form not in AMBIGUOUS
    }
